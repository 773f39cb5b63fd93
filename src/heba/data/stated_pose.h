// A pose that the robot states, and its error as a function of the effects that captures share.
#pragma once

#include <cstddef>
#include <memory>
#include <utility>

#include "heba/data/pair_problem.h"
#include "heba/data/pair_solution.h"
#include "heba/data/problem.h"
#include "heba/data/shared_effects.h"
#include "heba/data/solution.h"

namespace heba {

// The pose of the gripper as the robot states it; the identity for what is fixed in the base.
struct StatedPose {
  Rigid3d base_from_mount;
  // The error of the pose as a function of all effects of PairSolution::shared_effects, or of the arm's in
  // Problem::effects, such as MakeArmEffect's; null if the pose has none.
  std::shared_ptr<const PoseEffect> effect = nullptr;
  // View::gripper_by_joints, by which the noise of the joints is part of the pose's noise; empty if the joints are not
  // known.
  Matrix6X gripper_by_joints = Matrix6X(6, 0);

  StatedPose() = default;
  StatedPose(const Rigid3d& stated)  // NOLINT(google-explicit-constructor): most poses have no effect.
      : base_from_mount(stated) {}
  // An arm has both errors and noisy joints, so that neither can be given without the other.
  StatedPose(const Rigid3d& stated, std::shared_ptr<const PoseEffect> effect_in, Matrix6X gripper_by_joints_in)
      : base_from_mount(stated), effect(std::move(effect_in)), gripper_by_joints(std::move(gripper_by_joints_in)) {}
};

// Returns the pose of the gripper in a view.
StatedPose GripperPoseOf(Setup setup, const View& view);

// Returns the pose of an arm in a capture of a rig, whose effects are functions of those that are estimated.
StatedPose StatedPoseOf(const Problem& rig, const ProblemCapture& capture, size_t robot);

// The true pose according to a solution.
struct CorrectedPose {
  Rigid3d base_from_mount;
  // Derivative of its tangent (m, rad, in the mount's frame) by the unknowns of PairSolution::covariance: zero except
  // for the effects that captures share.
  Matrix6X by_unknowns;
};
CorrectedPose Correct(const PairSolution& solution, const StatedPose& stated);
// Likewise for the gripper of one arm of a rig, by the effects of that arm; the unknowns are those of
// Solution::covariance.
CorrectedPose Correct(const Problem& rig, const Solution& solution, size_t robot, const StatedPose& stated);

}  // namespace heba
