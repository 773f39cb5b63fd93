#include "heba/simulation/arm_captures.h"

#include <algorithm>
#include <cmath>

#include "heba/base/units.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_postures.h"

namespace heba {
namespace {

// Returns a posture in the middle of the arm's workspace, away from singularities.
Eigen::VectorXd HomePosture(const Arm& arm, Rng& rng) {
  constexpr int kMostDraws = 1000;
  // The reach is that of the arm in many postures.
  double reach_m = 0;
  std::vector<Eigen::VectorXd> drawn;
  for (int draw = 0; draw < kMostDraws; ++draw) {
    Eigen::VectorXd joints(arm.num_joints());
    for (double& joint : joints) joint = rng.Uniform(-kPi, kPi);
    reach_m = std::max(reach_m, BaseFromTip(arm, joints).translation.norm());
    drawn.push_back(std::move(joints));
  }
  for (const Eigen::VectorXd& joints : drawn) {
    const Eigen::Vector3d tip = BaseFromTip(arm, joints).translation;
    const double share = tip.head<2>().norm() / reach_m;
    if (share > 0.4 && share < 0.65 && tip.z() > 0.1 * reach_m && tip.z() < 0.6 * reach_m &&
        SingularityAt(arm, joints).empty()) {
      return joints;
    }
  }
  return drawn.front();
}

}  // namespace

std::optional<Eigen::VectorXd> DrawPosture(const Arm& arm, const Rigid3d& base_from_tip,
                                           const std::optional<Eigen::VectorXd>& near, bool has_several_configurations,
                                           Rng& rng) {
  if (arm.num_joints() > 6 || (near && !ConfigurationOf(arm, *near))) {
    CHECK(near.has_value());
    // A redundant arm reaches the pose in many ways.
    constexpr double kSpreadRad = 0.3;
    Eigen::VectorXd start = *near;
    for (double& joint : start) joint += rng.Uniform(-kSpreadRad, kSpreadRad);
    const Outcome<Eigen::VectorXd> found = PostureNear(arm, base_from_tip, start);
    return found ? std::optional<Eigen::VectorXd>(*found) : std::nullopt;
  }
  const Outcome<std::vector<Eigen::VectorXd>> postures = PosturesOf(arm, base_from_tip);
  if (!postures) return std::nullopt;
  std::vector<Eigen::VectorXd> allowed;
  for (const Eigen::VectorXd& posture : *postures) {
    if (!SingularityAt(arm, posture).empty()) continue;
    if (!near || has_several_configurations || ConfigurationOf(arm, posture) == ConfigurationOf(arm, *near)) {
      allowed.push_back(posture);
    }
  }
  if (allowed.empty()) return std::nullopt;
  return allowed[static_cast<size_t>(rng.Uniform() * static_cast<double>(allowed.size()))];
}

Eigen::VectorXd DrawArmErrors(const Arm& arm, const ArmErrorSigmas& sigmas, Rng& rng) {
  const double sigma_of_group[] = {sigmas.offset_rad, sigmas.length_m, sigmas.angle_rad, sigmas.compliance_rad_per_nm};
  constexpr size_t kCompliances = 3;
  const bool yields = arm.load != nullptr && sigmas.compliance_rad_per_nm > 0;
  Eigen::VectorXd errors = Eigen::VectorXd::Zero(arm.num_params());
  for (const SharedEffect& effect :
       ArmErrors(arm, yields ? ArmErrorModel::kGravity : ArmErrorModel::kGeometry).effects) {
    const double error = sigma_of_group[effect.group] * rng.Normal();
    errors[effect.index] = effect.group == kCompliances ? std::abs(error) : error;
  }
  return errors;
}

Rigid3d BaseFromGripper(const Arm& arm, const Eigen::VectorXd& joints, const Rigid3d& tip_from_gripper) {
  return BaseFromTip(arm, joints) * tip_from_gripper;
}

Outcome<ArmCaptures> SimulateArmCaptures(Setup setup, const Camera& camera, const Points3& points_in_target, bool z_out,
                                         const Arm& arm, const ArmMotionOptions& options, Rng& rng) {
  constexpr int kMostCells = 20;
  constexpr int kSurplus = 3;  // Poses that are drawn for one that must be reached.
  const Rigid3d gripper_from_tip = Inverse(options.tip_from_gripper);
  for (int cell = 0; cell < kMostCells; ++cell) {
    const Eigen::VectorXd home = HomePosture(arm, rng);
    const Rigid3d base_from_home = BaseFromGripper(arm, home, options.tip_from_gripper);
    MotionOptions motion = options.motion;
    motion.num_captures = 1 + kSurplus * options.motion.num_captures;
    const Outcome<std::vector<Rigid3d>> seen = SimulatePoses(camera, points_in_target, z_out, motion, rng);
    if (!seen) return Failure{seen.reason()};
    constexpr double kNearM = 0.08;
    const Rigid3d on_gripper{ExpRotation(rng.Uniform(0, 1.5) * rng.Direction3()), kNearM * rng.Direction3()};
    ArmCaptures captures;
    // At home, the camera sees the target as in the first of the poses.
    if (setup == Setup::kEyeToHand) {
      captures.hand_eye = {base_from_home * on_gripper * Inverse(seen->front()), on_gripper};
    } else {
      captures.hand_eye = {on_gripper, base_from_home * on_gripper * seen->front()};
    }
    for (size_t i = 1; i < seen->size(); ++i) {
      const Rigid3d mount = CameraMountFromTargetMount(captures.hand_eye, (*seen)[i]);
      const Rigid3d base_from_gripper = heba::BaseFromGripper(setup, mount);
      const std::optional<Eigen::VectorXd> posture =
          DrawPosture(arm, base_from_gripper * gripper_from_tip, home, options.has_several_configurations, rng);
      if (posture) captures.joints.push_back(*posture);
      if (captures.joints.size() == static_cast<size_t>(options.motion.num_captures)) return captures;
    }
  }
  return Failure{"the arm '" + arm.name + "' does not reach poses from which the camera sees the target"};
}

}  // namespace heba
