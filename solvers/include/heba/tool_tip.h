// Finds the tip of a tool from poses of the gripper at which the tip touches one fixed point (pivoting).
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/geometry/rigid3.h"

namespace heba {

struct ToolTip {
  Eigen::Vector3d in_gripper_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d touched_in_base_m = Eigen::Vector3d::Zero();
  // The covariance is that of in_gripper_m, by the scatter of the poses, which has 3 n - 6 degrees of freedom. The
  // errors of the arm depend on the pose and are common to similar poses, so that they are only partly in it.
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();
  double dof = 0;
  double rms_m = 0;               // The RMS is that of the distances below.
  std::vector<double> misfits_m;  // For each pose, the distance between its tip and the point.
};

// Minimises sum_i |R_i t + p_i - c|^2 over the tip t and the touched point c, with base_from_gripper (R_i, p_i).
// Returns a Failure `few_touches` for fewer than 3 poses, and `one_touch_axis` if the rotations leave the tip along an
// axis open: poses that differ by rotations about one axis.
Outcome<ToolTip> FindToolTip(const std::vector<Rigid3d>& base_from_gripper);

}  // namespace heba
