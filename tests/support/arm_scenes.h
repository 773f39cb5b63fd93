// Simulated captures of an arm whose parameters have errors, for the tests of their estimation.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/units.h"
#include "heba/robot/arm_errors.h"
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
  // Amplitude of an error of each joint that has two periods in a turn, which no model of an arm has.
  double joint_ripple_rad = 0;
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

ArmScene MakeArmScene(uint64_t seed, const ArmSceneOptions& options = {});

}  // namespace heba
