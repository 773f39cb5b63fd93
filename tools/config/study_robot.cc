#include "tools/config/study_robot.h"

#include <memory>
#include <utility>

#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_postures.h"
#include "heba/simulation/arm_captures.h"

namespace heba {
namespace {

constexpr int kNumPlaces = 20;
constexpr int kMostNamedJoints = 6;  // Arms with more reach a pose in infinitely many ways.

StudyPlace PlaceAt(const SceneConfig& scene, const Eigen::VectorXd& joints, bool is_inside) {
  const SceneArm& arm = *scene.arms[0];
  return {CameraMountFromTargetMount(*scene.setup, BaseFromGripper(arm.nominal, joints, arm.tip_from_gripper)),
          MakeArmEffect(arm.nominal, joints, arm.tip_from_gripper),
          GripperByJoints(arm.nominal, joints, arm.tip_from_gripper), is_inside};
}

// Returns postures in other configurations that reach the same pose, without those that are close to a singularity. For
// an arm whose configurations have no names: one posture far from this one, if there is any.
std::vector<Eigen::VectorXd> OtherPostures(const Arm& arm, const Eigen::VectorXd& joints, Rng& rng) {
  std::vector<Eigen::VectorXd> others;
  const Rigid3d base_from_tip = BaseFromTip(arm, joints);
  if (const std::optional<Configuration> configuration = ConfigurationOf(arm, joints)) {
    const Outcome<std::vector<Eigen::VectorXd>> postures = PosturesOf(arm, base_from_tip);
    for (size_t k = 0; postures && k < postures->size(); ++k) {
      const Eigen::VectorXd& posture = (*postures)[k];
      if (ConfigurationOf(arm, posture) != configuration && SingularityAt(arm, posture).empty()) {
        others.push_back(posture);
      }
    }
    return others;
  }
  constexpr int kMostTries = 20;
  constexpr double kFarRad = 1.0;
  for (int k = 0; k < kMostTries && others.empty(); ++k) {
    Eigen::VectorXd start = joints;
    for (double& joint : start) joint += rng.Uniform(-2, 2);
    const Outcome<Eigen::VectorXd> found = PostureNear(arm, base_from_tip, start);
    if (found && (*found - joints).cwiseAbs().maxCoeff() > kFarRad && SingularityAt(arm, *found).empty()) {
      others.push_back(*found);
    }
  }
  return others;
}

// Returns a posture that reaches the pose, for an arm that reaches it in infinitely many ways.
std::optional<Eigen::VectorXd> AnyPosture(const Arm& arm, const Rigid3d& base_from_tip, Rng& rng) {
  constexpr int kMostTries = 50;
  for (int k = 0; k < kMostTries; ++k) {
    Eigen::VectorXd start(arm.num_joints());
    for (double& joint : start) joint = rng.Uniform(-2, 2);
    const Outcome<Eigen::VectorXd> found = PostureNear(arm, base_from_tip, start);
    if (found && SingularityAt(arm, *found).empty()) return *found;
  }
  return std::nullopt;
}

// Returns the joints of at least `num_needed` poses that the arm reaches, from those that the camera of the scene can
// see.
Outcome<std::vector<Eigen::VectorXd>> DrawPostures(const SceneConfig& scene, size_t num_needed, Rng& rng) {
  constexpr int kPosesPerReached = 4;
  SceneConfig larger = scene;
  larger.options.motion.num_captures = kPosesPerReached * static_cast<int>(num_needed);
  const Outcome<std::vector<SimulatedPose>> poses = SimulateScenePoses(larger, rng);
  if (!poses) return poses.failure();
  const SceneArm& arm = *scene.arms[0];
  std::vector<Eigen::VectorXd> joints;
  for (const SimulatedPose& pose : *poses) {
    const Rigid3d base_from_tip =
        BaseFromGripper(*scene.setup, CameraMountFromTargetMount(HandEyeOf(scene), pose.camera_from_target)) *
        Inverse(arm.tip_from_gripper);
    std::optional<Eigen::VectorXd> near;
    if (joints.empty() && arm.nominal.num_joints() > kMostNamedJoints)
      near = AnyPosture(arm.nominal, base_from_tip, rng);
    if (!joints.empty()) near = joints.front();
    if (!near && arm.nominal.num_joints() > kMostNamedJoints) continue;
    const std::optional<Eigen::VectorXd> posture =
        DrawPosture(arm.nominal, base_from_tip, near, arm.has_several_configurations, rng);
    if (posture) joints.push_back(*posture);
    if (joints.size() == num_needed) return joints;
  }
  return Failure{"the arm " + arm.nominal.name + " reaches only " + std::to_string(joints.size()) + " of " +
                 std::to_string(poses->size()) + " poses; move hand_eye or board"};
}

}  // namespace

Outcome<CapturesOfCell> DrawArmCaptures(const SceneConfig& scene, Rng& rng) {
  const SceneArm& arm = *scene.arms[0];
  const auto num_captures = static_cast<size_t>(scene.options.motion.num_captures);
  const Outcome<std::vector<Eigen::VectorXd>> postures = DrawPostures(scene, num_captures + kNumPlaces, rng);
  if (!postures) return postures.failure();
  const bool yields = arm.sigmas.compliance_rad_per_nm > 0;
  SharedEffects errors = ArmErrors(arm.nominal, yields ? ArmErrorModel::kGravity : ArmErrorModel::kGeometry);
  errors.groups[0].sigma = arm.sigmas.offset_rad;
  errors.groups[1].sigma = arm.sigmas.length_m;
  errors.groups[2].sigma = arm.sigmas.angle_rad;
  if (yields) errors.groups[3].sigma = arm.sigmas.compliance_rad_per_nm;
  CapturesOfCell drawn;
  StudyRobot& robot = drawn.robot.emplace();
  robot.errors = std::make_shared<const SharedEffects>(std::move(errors));
  robot.joint_noise_rad = arm.joint_noise_rad;
  for (size_t i = 0; i < postures->size(); ++i) {
    const Eigen::VectorXd& joints = (*postures)[i];
    const StudyPlace place = PlaceAt(scene, joints, true);
    if (i < num_captures) {
      drawn.captures.push_back(
          {{CaptureRole::kNone, CameraFromTarget(HandEyeOf(scene), place.camera_mount_from_target_mount)}});
      robot.effects.push_back(place.effect);
      robot.gripper_by_joints.push_back(place.gripper_by_joints);
      continue;
    }
    robot.places.push_back(place);
    if (arm.has_several_configurations && ConfigurationOf(arm.nominal, joints)) continue;
    for (const Eigen::VectorXd& other : OtherPostures(arm.nominal, joints, rng)) {
      robot.places.push_back(PlaceAt(scene, other, false));
    }
  }
  return drawn;
}

}  // namespace heba
