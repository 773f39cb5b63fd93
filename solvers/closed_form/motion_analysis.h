// Analyses the robot's motion, without images, to decide whether a hand-eye calibration is possible.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/geometry/rigid3.h"

namespace heba {

struct MotionAnalysis {
  int num_captures = 0;
  // RMS of the rotation vectors relative to the mean orientation along their three principal directions, largest
  // first: (0, 0, 0) without rotation, (a, 0, 0) for rotations about a single axis.
  Eigen::Vector3d rotation_rms_rad = Eigen::Vector3d::Zero();
  // Axis of the largest rotation, in the child frame of the poses.
  Eigen::Vector3d main_axis = Eigen::Vector3d::UnitZ();
  double translation_rms_m = 0;
};

// Analyses one pose per capture: camera_mount_from_target_mount, or the inverse, for all captures.
MotionAnalysis AnalyseMotion(const std::vector<Rigid3d>& poses);

// Returns the reason why no method can find the hand-eye pose from such a motion; nothing if the motion is sufficient.
// The hand-eye pose requires rotations about two axes that are not parallel (Tsai and Lenz 1989, section II).
std::optional<Failure> WhyNotObservable(const MotionAnalysis& motion);

}  // namespace heba
