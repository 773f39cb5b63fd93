// What the robot's motion alone says about whether a hand-eye calibration is possible.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/geometry/rigid3.h"

namespace heba {

struct MotionAnalysis {
  int num_captures = 0;
  // Root mean square of the rotation vectors from the mean orientation, along their three principal directions, largest
  // first: (0, 0, 0) without rotation, (a, 0, 0) for turns about one axis.
  Eigen::Vector3d rotation_rms_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d main_axis = Eigen::Vector3d::UnitZ();  // Of the largest of them, in the moving mount's frame.
  double translation_rms_m = 0;
};

// `poses`: one pose of the same two frames a capture, camera_mount_from_target_mount or its inverse.
MotionAnalysis AnalyseMotion(const std::vector<Rigid3d>& poses);

// Why no method can find the hand-eye pose from such a motion, and what would cure it, as one clause; empty if one can.
// The hand-eye pose needs turns about two axes that are not parallel (Tsai and Lenz 1989, section II).
std::string WhyNotObservable(const MotionAnalysis& motion);

}  // namespace heba
