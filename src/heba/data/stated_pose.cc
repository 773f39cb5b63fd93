#include "heba/data/stated_pose.h"

#include "heba/base/error.h"

namespace heba {

StatedPose GripperPoseOf(Setup setup, const View& view) {
  return {BaseFromGripper(setup, view.camera_mount_from_target_mount), view.effect, view.gripper_by_joints};
}

CorrectedPose Correct(const Solution& solution, const StatedPose& stated) {
  CorrectedPose corrected{stated.base_from_mount, Matrix6X::Zero(6, solution.covariance.matrix.cols())};
  if (stated.effect == nullptr || solution.shared_effects == nullptr) return corrected;
  const SharedEffects& shared = *solution.shared_effects;
  Matrix6X by_all;
  corrected.base_from_mount =
      stated.base_from_mount * stated.effect->Evaluate(AllEffects(shared, solution.effects), &by_all);
  const UnknownBlock block = solution.covariance.layout.Block(kRobotBlock);
  if (block.size == 0) return corrected;
  CHECK_EQ(block.size, shared.size());
  for (Eigen::Index i = 0; i < block.size; ++i) {
    corrected.by_unknowns.col(block.first + i) = by_all.col(shared.effects[static_cast<size_t>(i)].index);
  }
  return corrected;
}

}  // namespace heba
