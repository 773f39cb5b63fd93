#include "heba/tool_tip.h"

#include <cmath>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"

namespace heba {

Outcome<ToolTip> FindToolTip(const std::vector<Rigid3d>& base_from_gripper) {
  constexpr size_t kFewest = 3;
  if (base_from_gripper.size() < kFewest) {
    return Failure{FailureCode("few_touches"), {{"poses", static_cast<double>(base_from_gripper.size())}}};
  }
  const auto num_poses = static_cast<double>(base_from_gripper.size());
  Eigen::Matrix3d mean_rotation = Eigen::Matrix3d::Zero();
  Eigen::Vector3d mean_position_m = Eigen::Vector3d::Zero();
  for (const Rigid3d& pose : base_from_gripper) {
    mean_rotation += pose.RotationMatrix() / num_poses;
    mean_position_m += pose.translation / num_poses;
  }
  // The touched point is the mean of the tips, which leaves the tip alone.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Rigid3d& pose : base_from_gripper) {
    const Eigen::Matrix3d rotation = pose.RotationMatrix() - mean_rotation;
    normal += rotation.transpose() * rotation;
    right -= rotation.transpose() * (pose.translation - mean_position_m);
  }
  // Rotations by an angle a about two axes leave an eigenvalue of about n a^2 / 2.
  constexpr double kLeastAngleRad = 0.01;
  const SymmetricEigen<3> eigen = EigenOfSymmetric(normal);
  if (eigen.values[0] < 0.5 * num_poses * kLeastAngleRad * kLeastAngleRad) {
    const Eigen::Vector3d axis = eigen.vectors.col(0);
    return Failure{FailureCode("one_touch_axis"), {{"x", axis.x()}, {"y", axis.y()}, {"z", axis.z()}}};
  }
  ToolTip tip;
  tip.in_gripper_m = SolveSymmetric(normal, right);
  tip.touched_in_base_m = mean_rotation * tip.in_gripper_m + mean_position_m;
  double squares_m2 = 0;
  for (const Rigid3d& pose : base_from_gripper) {
    tip.misfits_m.push_back((pose * tip.in_gripper_m - tip.touched_in_base_m).norm());
    squares_m2 += tip.misfits_m.back() * tip.misfits_m.back();
  }
  tip.rms_m = std::sqrt(squares_m2 / num_poses);
  tip.dof = 3 * num_poses - 6;
  tip.covariance_m2 = squares_m2 / tip.dof * InverseOfSymmetric(normal);
  return tip;
}

}  // namespace heba
