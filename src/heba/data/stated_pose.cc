#include "heba/data/stated_pose.h"

#include <memory>
#include <string_view>
#include <utility>
#include <vector>

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

// An effect of those that are estimated, as a function of all.
class EffectOfAll final : public PoseEffect {
 public:
  EffectOfAll(std::shared_ptr<const PoseEffect> effect, const SharedEffects& shared) : effect_(std::move(effect)) {
    for (const SharedEffect& estimated : shared.effects) indices_.push_back(estimated.index);
  }
  Rigid3d Evaluate(const Eigen::VectorXd& effects, Matrix6X* tangent_from_effects) const override {
    const Eigen::VectorXd estimated = effects(indices_);
    if (tangent_from_effects == nullptr) return effect_->Evaluate(estimated, nullptr);
    Matrix6X by_estimated;
    const Rigid3d pose = effect_->Evaluate(estimated, &by_estimated);
    tangent_from_effects->setZero(6, effects.size());
    (*tangent_from_effects)(Eigen::all, indices_) = by_estimated;
    return pose;
  }

 private:
  std::shared_ptr<const PoseEffect> effect_;
  std::vector<Eigen::Index> indices_;
};

}  // namespace

StatedPose StatedPoseOf(const Problem& rig, const ProblemCapture& capture, size_t robot) {
  StatedPose stated(capture.base_from_gripper[robot]);
  const SharedEffects* const shared = EffectsOf(rig, robot);
  if (shared != nullptr && !capture.effects.empty() && capture.effects[robot] != nullptr) {
    stated.effect = std::make_shared<EffectOfAll>(capture.effects[robot], *shared);
  }
  if (!capture.postures.empty()) stated.gripper_by_joints = capture.postures[robot].gripper_by_joints;
  return stated;
}

StatedPose GripperPoseOf(Setup setup, const View& view) {
  return {BaseFromGripper(setup, view.camera_mount_from_target_mount), view.effect, view.gripper_by_joints};
}

CorrectedPose Correct(const PairSolution& solution, const StatedPose& stated) {
  return CorrectBy(solution.shared_effects.get(), solution.effects, solution.covariance, kRobotBlock, stated);
}

CorrectedPose Correct(const Problem& rig, const Solution& solution, size_t robot, const StatedPose& stated) {
  const SharedEffects* const shared = EffectsOf(rig, robot);
  const Eigen::VectorXd values = shared == nullptr ? Eigen::VectorXd() : solution.effects[robot];
  return CorrectBy(shared, values, solution.covariance, ErrorsBlock(rig.robots[robot]), stated);
}

}  // namespace heba
