#include "tools/run/time_offset.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "heba/base/even_indices.h"
#include "heba/base/units.h"
#include "heba/camera_calibration.h"
#include "heba/data/pose_stream.h"
#include "tools/run/captures.h"

namespace heba {
namespace {

// The target turned by an angle between two captures.
struct Turn {
  double from_s = 0;
  double to_s = 0;
  double angle_rad = 0;
};

// Returns angles between captures that are up to some places apart.
std::vector<Turn> TurnsOf(const Dataset& dataset, std::vector<SeenPose> seen) {
  constexpr std::array<size_t, 6> kApart = {1, 2, 4, 8, 16, 32};
  constexpr size_t kMostOfEach = 150;
  const auto time_of = [&](const SeenPose& pose) { return *dataset.captures[pose.capture].time_s; };
  std::sort(seen.begin(), seen.end(), [&](const auto& a, const auto& b) { return time_of(a) < time_of(b); });
  std::vector<Turn> turns;
  for (const size_t apart : kApart) {
    if (apart >= seen.size()) break;
    for (const size_t i : EvenIndices(seen.size() - apart, std::min(kMostOfEach, seen.size() - apart))) {
      const SeenPose& from = seen[i];
      const SeenPose& to = seen[i + apart];
      turns.push_back({time_of(from), time_of(to), AngleRad(from.camera_from_target, to.camera_from_target)});
    }
  }
  return turns;
}

// Returns how badly the robot's turns agree at an offset; those that disagree widely count no more than others.
double Disagreement(const PoseStream& stream, const std::vector<Turn>& turns, double offset_s) {
  constexpr double kWideRad = DegToRad(0.5);
  double sum = 0;
  for (const Turn& turn : turns) {
    const double angle_rad = AngleRad(PoseAt(stream, turn.from_s + offset_s), PoseAt(stream, turn.to_s + offset_s));
    const double error_rad = std::abs(angle_rad - turn.angle_rad);
    sum += error_rad / (error_rad + kWideRad);
  }
  return sum;
}

// Returns the poses of a target that the images of a camera show, with a camera that is calibrated from them alone;
// none if there is no such calibration.
std::vector<SeenPose> PosesOfPair(const Dataset& dataset, const std::vector<TargetDetection>& detections, size_t camera,
                                  size_t target) {
  const Camera& of_images = dataset.rig.cameras[camera].camera;
  CameraCalibrationOptions options;
  options.model = of_images.model;
  // Angles need no better lens.
  if (options.model.empty()) options.model = "brown5";
  options.width_px = of_images.width_px;
  options.height_px = of_images.height_px;
  options.choose_bend = false;
  options.folds = 0;
  std::vector<View> views;
  for (const TargetDetection& seen : detections) {
    const Detection& detection = seen.detection.detection;
    if (seen.camera != camera || seen.target != target || detection.ids.empty()) continue;
    View& view = views.emplace_back();
    view.name = dataset.captures[seen.capture].name;
    view.observations = ObservationsOf(*dataset.targets[target], detection);
    view.capture = seen.capture;
  }
  const Outcome<CameraCalibration> calibration = CalibrateCamera(views, options);
  if (!calibration) return {};
  std::vector<SeenPose> poses;
  for (const CameraViewOutcome& view : calibration->views) {
    if (view.used) poses.push_back({view.capture, view.camera_from_target});
  }
  return poses;
}

// The finding `time_offset`: the offset that was estimated, or that the captures do not determine it.
Finding DescribeTimeOffset(const std::optional<EstimatedTimeOffset>& offset) {
  Finding finding;
  finding.code = FindingCode("time_offset");
  if (offset) {
    finding.numbers = {{"offset_ms", 1000 * offset->value_s}, {"sigma_ms", 1000 * offset->sigma_s}};
  } else {
    finding.grade = Grade::kDoubtful;
  }
  return finding;
}

}  // namespace

Dataset WithPosesAt(Dataset dataset, double offset_s) {
  for (Recording& capture : dataset.captures) {
    capture.base_from_gripper = {PoseAt(*dataset.stream, *capture.time_s + offset_s)};
  }
  return dataset;
}

std::vector<Tangent6> VelocitiesAt(const Dataset& dataset, double offset_s) {
  std::vector<Tangent6> velocities;
  for (const Recording& capture : dataset.captures) {
    velocities.push_back(VelocityAt(*dataset.stream, *capture.time_s + offset_s));
  }
  return velocities;
}

std::vector<std::vector<SeenPose>> PosesInImages(const Dataset& dataset,
                                                 const std::vector<TargetDetection>& detections) {
  std::vector<std::vector<SeenPose>> seen;
  if (!dataset.target_poses.empty()) {
    std::vector<SeenPose>& given = seen.emplace_back();
    for (size_t i = 0; i < dataset.target_poses.size(); ++i) given.push_back({i, dataset.target_poses[i]});
    return seen;
  }
  for (size_t c = 0; c < dataset.rig.cameras.size(); ++c) {
    for (size_t t = 0; t < dataset.rig.targets.size(); ++t) {
      if (!MovesAgainst(dataset.rig.cameras[c].mount, dataset.rig.targets[t].mount)) continue;
      seen.push_back(PosesOfPair(dataset, detections, c, t));
    }
  }
  return seen;
}

double FindTimeOffset(const Dataset& dataset, const std::vector<std::vector<SeenPose>>& seen) {
  std::vector<Turn> turns;
  for (const std::vector<SeenPose>& of_pair : seen) {
    const std::vector<Turn> more = TurnsOf(dataset, of_pair);
    turns.insert(turns.end(), more.begin(), more.end());
  }
  constexpr double kStepS = 0.005;
  constexpr int kNumSteps = 400;
  constexpr double kClearlyBetter = 0.95;
  double best_s = 0;
  double least = Disagreement(*dataset.stream, turns, 0);
  const double at_zero = least;
  for (int step = 1; step <= kNumSteps; ++step) {
    for (const double offset_s : {step * kStepS, -step * kStepS}) {
      const double disagreement = Disagreement(*dataset.stream, turns, offset_s);
      if (disagreement >= least) continue;
      least = disagreement;
      best_s = offset_s;
    }
  }
  return least < kClearlyBetter * at_zero ? best_s : 0;
}

RunResult WithTimeOffset(RunResult result, double offset_s, const std::optional<TimeOffset>& rest) {
  if (rest) result.time_offset = EstimatedTimeOffset{offset_s, rest->sigma_s};
  result.observations.push_back(DescribeTimeOffset(result.time_offset));
  return result;
}

}  // namespace heba
