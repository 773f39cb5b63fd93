// The poses of a robot that was recorded as a stream (Dataset::stream), and the offset of its clock to the camera's.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "heba/data/drift.h"
#include "heba/evaluation/finding.h"
#include "heba/run_types.h"
#include "solvers/calibration/time_offset.h"

namespace heba {

// Returns the data set with the poses of the stream at the times of its captures plus an offset.
Dataset WithPosesAt(Dataset dataset, double offset_s);

// Returns the velocities of the gripper (VelocityAt) in the captures.
std::vector<Tangent6> VelocitiesAt(const Dataset& dataset, double offset_s);

// The pose of the target that an image shows.
struct SeenPose {
  size_t capture = 0;  // An index into Dataset::captures.
  Rigid3d camera_from_target;
};
// Returns a list for each camera and target that the arm moves against each other: the data set's target_poses or, with
// a camera that is calibrated from the images alone, those of the detections; the list is empty if there is no such
// calibration.
std::vector<std::vector<SeenPose>> PosesInImages(const Dataset& dataset,
                                                 const std::vector<TargetDetection>& detections);

// Returns an offset at which the angles through which the robot turns between captures agree with those that the images
// show; 0 if none is clearly better. The angles do not depend on the hand-eye pose. Offsets of up to two seconds are
// tried.
double FindTimeOffset(const Dataset& dataset, const std::vector<std::vector<SeenPose>>& seen);

// Calibrates with an offset of time that is estimated beside all unknowns until so little is left of it that it matters
// to nobody. `calibrate_at` returns the calibration at an offset, with what it leaves of it (`rest`).
template <typename CalibrateAt>
auto SettleOffset(double offset_s, const CalibrateAt& calibrate_at) {
  constexpr int kMostRounds = 8;
  constexpr double kLongestStepS = 0.1;
  constexpr double kSettledSigmas = 0.1;
  auto last = calibrate_at(offset_s);
  for (int round = 1; round < kMostRounds; ++round) {
    if (!last.rest || std::abs(last.rest->change_s) < kSettledSigmas * last.rest->sigma_s) return last;
    offset_s += std::clamp(last.rest->change_s, -kLongestStepS, kLongestStepS);
    auto next = calibrate_at(offset_s);
    // An offset with which there is no calibration is none.
    if (!next.IsCalibrated()) return last;
    last = std::move(next);
  }
  return last;
}

// Returns a result with the offset and the finding `time_offset`. `rest`: what a calibration leaves of it; nothing if
// the captures do not determine it.
RunResult WithTimeOffset(RunResult result, double offset_s, const std::optional<TimeOffset>& rest);

}  // namespace heba
