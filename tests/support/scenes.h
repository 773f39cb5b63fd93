// Simulated problems for tests, determined by a seed.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "heba/base/units.h"
#include "heba/data/pair_problem.h"
#include "heba/evaluation/metrics.h"
#include "heba/simulation/scene.h"

namespace heba {

// Returns a centred grid of columns x rows points in the plane z = 0.
Points3 GridPoints(int columns, int rows, double spacing_m);

Camera TestCamera(const std::string& model = "brown5");

struct TestScene {
  Camera camera;
  HandEye hand_eye;
  std::vector<View> views;
  std::vector<PosePair> pairs;  // Free of noise.
};

struct TestSceneOptions {
  int num_captures = 15;
  double noise_px = 0;
  Points3 points = GridPoints(8, 6, 0.03);                                   // Design points, which the views hold.
  std::array<double, TargetShape::kNumParams> shape = TargetShape().params;  // Shape as printed.
  Camera camera = TestCamera();
  Setup setup = Setup::kEyeToHand;
  double max_tilt_rad = 0.6;
  double distance_m = 0.7;
  // One sigma of the error of the robot poses in the views, along and about each axis of the gripper.
  double robot_translation_m = 0;
  double robot_rotation_rad = 0;
  // kTwoStep: home, two translations and num_captures - 3 rotations, with their roles.
  enum class Motion { kFree, kTwoStep };
  Motion motion = Motion::kFree;
};

TestScene MakeTestScene(uint64_t seed, const TestSceneOptions& options = {});

}  // namespace heba
