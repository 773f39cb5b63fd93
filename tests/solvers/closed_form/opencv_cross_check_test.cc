// Cross-check of the closed forms of heba and OpenCV, two implementations of the same papers.
//
// Both are compared only where OpenCV 4.6 of Debian is correct: no two captures may differ by a rotation of 120 deg
// or more (see OpenCvLargeTurns).
#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "solvers/closed_form/hand_eye_method.h"
#include "tests/support/matchers.h"
#include "tests/support/opencv_version.h"
#include "tests/support/scenes.h"
#include "tools/bench/opencv_calibration.h"

namespace heba {
namespace {

// Returns a scene in which no two captures differ by a rotation of more than `max_turn_rad`. Gaussian noise is added
// to the camera poses.
TestScene SceneOfTurns(heba::Setup setup, uint64_t seed, double max_turn_rad, double rotation_sigma_rad,
                       double translation_sigma_m) {
  TestSceneOptions options;
  options.setup = setup;
  options.num_captures = 30;
  TestScene scene = MakeTestScene(seed, options);
  std::vector<PosePair> kept;
  for (const PosePair& pair : scene.pairs) {
    const bool fits = std::all_of(kept.begin(), kept.end(), [&](const PosePair& other) {
      return AngleRad(pair.camera_from_target, other.camera_from_target) < max_turn_rad;
    });
    if (fits) kept.push_back(pair);
  }
  Rng rng(seed + 1000);
  for (PosePair& pair : kept) {
    pair.camera_from_target = WithRobotNoise(pair.camera_from_target, rotation_sigma_rad, translation_sigma_m, rng);
  }
  scene.pairs = kept;
  return scene;
}

constexpr double kSoundTurnRad = 1.9;  // Less than 120 deg.

class OpenCvCrossCheck : public testing::TestWithParam<std::string> {
 protected:
  Rigid3d Ours(const TestScene& scene) const {
    return FindHandEyeMethod(GetParam())->solve(scene.pairs)->camera_mount_from_camera;
  }
  Rigid3d Theirs(const TestScene& scene) const { return SolveHandEyeWithOpenCv(GetParam(), scene.pairs); }
};

TEST_P(OpenCvCrossCheck, AgreesOnExactData) {
  constexpr double kRoundOff = 1e-9;  // rad and m
  for (const heba::Setup setup : {heba::Setup::kEyeInHand, heba::Setup::kEyeToHand}) {
    for (uint64_t seed = 1; seed <= 10; ++seed) {
      const TestScene scene = SceneOfTurns(setup, seed, kSoundTurnRad, 0, 0);
      ASSERT_GE(scene.pairs.size(), 8U);
      EXPECT_THAT(Theirs(scene), IsNearPose(Ours(scene), kRoundOff, kRoundOff)) << SetupName(setup) << " " << seed;
    }
  }
}

// The camera poses have noise of 0.02 deg and 0.2 mm per axis. The two implementations weight their equations
// differently, so they differ by about as much as their own errors: up to 0.02 deg and 0.6 mm.
TEST_P(OpenCvCrossCheck, AgreesWithinTheErrorOnNoisyData) {
  for (const heba::Setup setup : {heba::Setup::kEyeInHand, heba::Setup::kEyeToHand}) {
    for (uint64_t seed = 1; seed <= 10; ++seed) {
      const TestScene scene = SceneOfTurns(setup, seed, kSoundTurnRad, DegToRad(0.02), 0.0002);
      EXPECT_THAT(Theirs(scene), IsNearPose(Ours(scene), DegToRad(0.04), 0.001)) << SetupName(setup) << " " << seed;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Table, OpenCvCrossCheck,
                         testing::Values("tsai", "park", "horaud", "andreff", "daniilidis", "shah", "li"),
                         [](const auto& test) { return test.param; });

// If two captures differ by a rotation of more than 120 deg, OpenCV's Tsai and Daniilidis choose the sign of its
// quaternion arbitrarily. They then compare a rotation by more than 180 deg with one by less. Exact data give errors
// of degrees in both setups; heba's methods stay exact.
class OpenCvLargeTurns : public testing::TestWithParam<std::string> {};

TEST_P(OpenCvLargeTurns, GiveWrongPosesForExactData) {
  double worst_rad = 0;
  for (const heba::Setup setup : {heba::Setup::kEyeInHand, heba::Setup::kEyeToHand}) {
    // There are enough scenes for some to have such rotations with every compiler's order of random numbers.
    for (uint64_t seed = 1; seed <= 60; ++seed) {
      const TestScene scene = SceneOfTurns(setup, seed, kPi, 0, 0);
      const Rigid3d truth = scene.hand_eye.camera_mount_from_camera;
      worst_rad = std::max(worst_rad, AngleRad(SolveHandEyeWithOpenCv(GetParam(), scene.pairs), truth));
      EXPECT_THAT(FindHandEyeMethod(GetParam())->solve(scene.pairs)->camera_mount_from_camera,
                  IsNearPose(truth, 1e-9, 1e-9));
    }
  }
  // OpenCV 4.10 is exact, too.
  if (IsOpenCvBefore(4, 10)) {
    EXPECT_GT(worst_rad, DegToRad(1));
  }
}

INSTANTIATE_TEST_SUITE_P(Table, OpenCvLargeTurns, testing::Values("tsai", "daniilidis"),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace heba
