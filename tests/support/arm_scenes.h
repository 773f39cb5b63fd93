// Simulated captures of an arm whose parameters have errors, for the tests of their estimation.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/units.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_table.h"
#include "heba/simulation/arm_captures.h"
#include "tests/support/scenes.h"

namespace heba {

struct ArmSceneOptions {
  std::string arm = "ur5e";
  Setup setup = Setup::kEyeToHand;
  int num_captures = 20;
  double noise_px = 0.1;
  bool has_several_configurations = true;
  // Sigmas of the errors of offsets, lengths and angles, of which those that can be determined are drawn.
  double offset_rad = DegToRad(0.05);
  double length_m = 0.3e-3;
  double angle_rad = DegToRad(0.03);
  double compliance_rad_per_nm = 0;
  double joint_noise_rad = DegToRad(0.003);
  std::vector<std::pair<int, double>> changes = {};  // Further errors: the place of a parameter, rad or m.
  std::optional<Rigid3d> tip_from_gripper = {};      // Random by default.
  Points3 points = TestSceneOptions().points;
};

struct ArmScene {
  Arm nominal;
  Eigen::VectorXd errors;  // One per parameter.
  Rigid3d tip_from_gripper;
  std::vector<Eigen::VectorXd> joints;
  TestScene scene;  // The views hold the poses that the controller reports, and the effects of the errors.
};

inline ArmScene MakeArmScene(uint64_t seed, const ArmSceneOptions& options = {}) {
  Rng rng(seed);
  ArmScene made;
  made.nominal = *FindArm(options.arm);
  made.errors = DrawArmErrors(
      made.nominal, {options.offset_rad, options.length_m, options.angle_rad, options.compliance_rad_per_nm}, &rng);
  for (const auto& [place, change] : options.changes) made.errors[place] += change;
  const TestSceneOptions plain;
  TestScene& scene = made.scene;
  scene.camera = plain.camera;
  ArmMotionOptions motion;
  motion.motion.num_captures = options.num_captures;
  motion.motion.max_tilt_rad = plain.max_tilt_rad;
  motion.has_several_configurations = options.has_several_configurations;
  motion.tip_from_gripper = Rigid3d(ExpRotation(rng.Direction3()), 0.1 * rng.Direction3());
  if (options.tip_from_gripper) motion.tip_from_gripper = *options.tip_from_gripper;
  const Outcome<ArmCaptures> captures =
      SimulateArmCaptures(options.setup, scene.camera, options.points, false, made.nominal, motion, &rng);
  CHECK(captures.ok()) << captures.reason();
  scene.hand_eye = captures->hand_eye;
  made.tip_from_gripper = motion.tip_from_gripper;
  made.joints = captures->joints;
  const Arm actual = WithChanges(made.nominal, made.errors);
  const auto mount_of = [&](const Arm& arm, const Eigen::VectorXd& joints) {
    return CameraMountFromTargetMount(options.setup, BaseFromGripper(arm, joints, motion.tip_from_gripper));
  };
  for (const Eigen::VectorXd& joints : made.joints) {
    Eigen::VectorXd reached = joints;
    for (double& joint : reached) joint += options.joint_noise_rad * rng.Normal();
    std::optional<View> view = SimulateView("view_" + std::to_string(scene.views.size()), scene.camera, scene.hand_eye,
                                            mount_of(actual, reached), options.points, options.noise_px, &rng);
    CHECK(view.has_value());
    view->capture = scene.views.size();
    view->camera_mount_from_target_mount = mount_of(made.nominal, joints);
    view->effect = MakeArmEffect(made.nominal, joints, motion.tip_from_gripper);
    view->gripper_by_joints = GripperByJoints(made.nominal, joints, motion.tip_from_gripper);
    scene.views.push_back(std::move(*view));
  }
  return made;
}

}  // namespace heba
