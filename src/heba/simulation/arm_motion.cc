#include "heba/simulation/arm_motion.h"

#include <string>
#include <utility>

#include "heba/simulation/arm_captures.h"

namespace heba {

std::optional<Reached> Reach(const SimulatedArm& arm, const Arm& of_posture, const Rigid3d& base_from_gripper,
                             const std::optional<Eigen::VectorXd>& near, Rng& rng) {
  const std::optional<Eigen::VectorXd> posture = DrawPosture(
      of_posture, base_from_gripper * Inverse(arm.tip_from_gripper), near, arm.has_several_configurations, rng);
  if (!posture) return std::nullopt;
  Eigen::VectorXd reached = *posture;
  for (double& joint : reached) joint += arm.joint_noise_rad * rng.Normal();
  return Reached{*posture, BaseFromGripper(WithChanges(arm.nominal, arm.errors), reached, arm.tip_from_gripper),
                 BaseFromGripper(arm.nominal, *posture, arm.tip_from_gripper)};
}

Outcome<ArmMotion> SimulateArmMotion(const Problem& rig, const CellPoses& poses,
                                     const std::vector<SimulatedTarget>& targets, const SceneOptions& options,
                                     const std::vector<std::optional<SimulatedArm>>& arms, Rng& rng) {
  constexpr int kMostRounds = 20;
  const auto num_captures = static_cast<size_t>(options.motion.num_captures);
  std::vector<std::optional<Eigen::VectorXd>> home(rig.robots.size());
  ArmMotion motion;
  for (int round = 0; round < kMostRounds && motion.exact.size() < num_captures; ++round) {
    const Outcome<std::vector<ArmPoses>> drawn = SimulateArmPoses(rig, poses, targets, options, rng);
    if (!drawn) return Failure{drawn.reason()};
    for (const ArmPoses& wanted : *drawn) {
      ArmPoses exact = wanted;
      ArmPoses stated = wanted;
      std::vector<Eigen::VectorXd> joints(rig.robots.size());
      bool is_reached = true;
      for (size_t r = 0; r < arms.size() && is_reached; ++r) {
        if (!arms[r]) continue;
        const std::optional<Reached> reached = Reach(*arms[r], arms[r]->nominal, wanted[r], home[r], rng);
        is_reached = reached.has_value();
        if (!reached) continue;
        if (!home[r]) home[r] = reached->joints;
        joints[r] = reached->joints;
        exact[r] = reached->exact;
        stated[r] = reached->stated;
      }
      if (!is_reached) continue;
      motion.exact.push_back(std::move(exact));
      motion.stated.push_back(std::move(stated));
      motion.joints.push_back(std::move(joints));
      if (motion.exact.size() == num_captures) break;
    }
  }
  if (motion.exact.size() < num_captures) {
    return Failure{"the arms reach " + std::to_string(motion.exact.size()) + " of " + std::to_string(num_captures) +
                   " poses from which a camera sees a target; move the cameras and targets nearer to the arms"};
  }
  return motion;
}

std::vector<ProblemCapture> SimulateCaptures(const Problem& rig, const CellPoses& poses,
                                             const std::vector<SimulatedTarget>& targets, const ArmMotion& motion,
                                             const SceneOptions& options, Rng& rng) {
  std::vector<ProblemCapture> captures = SimulateCaptures(rig, poses, targets, motion.exact, options, rng);
  for (size_t i = 0; i < captures.size(); ++i) {
    for (size_t r = 0; r < rig.robots.size(); ++r) {
      Rigid3d& reported = captures[i].base_from_gripper[r];
      reported = motion.stated[i][r] * (Inverse(motion.exact[i][r]) * reported);
    }
  }
  return captures;
}

}  // namespace heba
