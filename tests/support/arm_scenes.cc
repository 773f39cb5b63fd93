#include "tests/support/arm_scenes.h"

#include "heba/base/error.h"
#include "heba/robot/arm_table.h"
#include "heba/simulation/arm_captures.h"
#include "tests/support/scene_rng.h"

namespace heba {

ArmScene MakeArmScene(uint64_t seed, const ArmSceneOptions& options) {
  Rng rng = SceneRng(seed);
  ArmScene made;
  made.nominal = *FindArm(options.arm);
  made.errors = DrawArmErrors(
      made.nominal, {options.offset_rad, options.length_m, options.angle_rad, options.compliance_rad_per_nm}, rng);
  for (const auto& [place, change] : options.changes) made.errors[place] += change;
  const TestSceneOptions plain;
  TestScene& scene = made.scene;
  scene.camera = plain.camera;
  ArmMotionOptions motion;
  motion.motion.num_captures = options.num_captures;
  motion.motion.max_tilt_rad = plain.max_tilt_rad;
  motion.has_several_configurations = options.has_several_configurations;
  motion.tip_from_gripper = Rigid3d{ExpRotation(rng.Direction3()), 0.1 * rng.Direction3()};
  if (options.tip_from_gripper) motion.tip_from_gripper = *options.tip_from_gripper;
  const Outcome<ArmCaptures> captures =
      SimulateArmCaptures(options.setup, scene.camera, options.points, false, made.nominal, motion, rng);
  CHECK(captures.ok()) << captures.reason();
  scene.hand_eye = captures->hand_eye;
  made.tip_from_gripper = motion.tip_from_gripper;
  made.joints = captures->joints;
  const Arm actual = WithChanges(made.nominal, made.errors);
  const auto mount_of = [&](const Arm& arm, const Eigen::VectorXd& joints) {
    return CameraMountFromTargetMount(options.setup, BaseFromGripper(arm, joints, motion.tip_from_gripper));
  };
  Eigen::VectorXd phases_rad = Eigen::VectorXd::Zero(made.nominal.num_joints());
  if (options.joint_ripple_rad > 0) {
    for (double& phase : phases_rad) phase = rng.Uniform(-kPi, kPi);
  }
  for (const Eigen::VectorXd& joints : made.joints) {
    Eigen::VectorXd reached = joints + options.joint_ripple_rad * (2 * joints + phases_rad).array().sin().matrix();
    for (double& joint : reached) joint += options.joint_noise_rad * rng.Normal();
    std::optional<View> view = SimulateView("view_" + std::to_string(scene.views.size()), scene.camera, scene.hand_eye,
                                            mount_of(actual, reached), options.points, options.noise_px, rng);
    CHECK(view.has_value());
    view->capture = scene.views.size();
    view->camera_mount_from_target_mount = mount_of(made.nominal, joints);
    view->effect = MakeArmEffect(made.nominal, joints, motion.tip_from_gripper);
    view->gripper_by_joints = GripperByJoints(made.nominal, joints, motion.tip_from_gripper);
    scene.pairs.push_back(
        {view->camera_mount_from_target_mount, CameraFromTarget(scene.hand_eye, mount_of(actual, reached))});
    scene.views.push_back(std::move(*view));
  }
  return made;
}

}  // namespace heba
