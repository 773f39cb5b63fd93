#include "heba/data/stated_pose.h"

#include <string_view>

#include "heba/base/error.h"

namespace heba {
namespace {

// Corrects a pose by the estimated values of effects, which are a block of the covariance; null for no effects.
CorrectedPose CorrectBy(const SharedEffects* shared, const Eigen::VectorXd& values, const Covariance& covariance,
                        std::string_view block_name, const StatedPose& stated) {
  CorrectedPose corrected{stated.base_from_mount, Matrix6X::Zero(6, covariance.matrix.cols())};
  if (stated.effect == nullptr || shared == nullptr) return corrected;
  Matrix6X by_all;
  corrected.base_from_mount = stated.base_from_mount * stated.effect->Evaluate(AllEffects(*shared, values), &by_all);
  const UnknownBlock block = covariance.layout.Block(block_name);
  if (block.size == 0) return corrected;
  CHECK_EQ(block.size, shared->size());
  for (Eigen::Index i = 0; i < block.size; ++i) {
    corrected.by_unknowns.col(block.first + i) = by_all.col(shared->effects[static_cast<size_t>(i)].index);
  }
  return corrected;
}

}  // namespace

StatedPose GripperPoseOf(Setup setup, const View& view) {
  return {BaseFromGripper(setup, view.camera_mount_from_target_mount), view.effect, view.gripper_by_joints};
}

CorrectedPose Correct(const Solution& solution, const StatedPose& stated) {
  return CorrectBy(solution.shared_effects.get(), solution.effects, solution.covariance, kRobotBlock, stated);
}

CorrectedPose Correct(const RigProblem& rig, const RigSolution& solution, size_t robot, const StatedPose& stated) {
  const SharedEffects* const shared = EffectsOf(rig, robot);
  const Eigen::VectorXd values = shared == nullptr ? Eigen::VectorXd() : solution.effects[robot];
  return CorrectBy(shared, values, solution.covariance, ErrorsBlock(rig.robots[robot]), stated);
}

}  // namespace heba
