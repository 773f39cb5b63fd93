// Requirements for every closed-form method in the table of methods.
#include <cmath>

#include <gtest/gtest.h>

#include "solvers/closed_form/hand_eye_method.h"
#include "tests/support/matchers.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

// Makes a scene with the motion that the method needs.
TestScene SceneFor(const std::string& method, uint64_t seed, TestSceneOptions options = {}) {
  if (FindHandEyeMethod(method)->motion == MethodMotion::kTwoStep) options.motion = TestSceneOptions::Motion::kTwoStep;
  return MakeTestScene(seed, options);
}

constexpr double kRoundOff =
    1e-8;  // rad and m: exact data; null vectors of 24 x 24 normal matrices in double precision.

class HandEyeMethodTest : public testing::TestWithParam<std::string> {
 protected:
  Outcome<HandEye> Solve(const std::vector<PosePair>& pairs) const {
    return FindHandEyeMethod(GetParam())->solve(pairs);
  }
};

std::vector<PosePair> WithNoise(std::vector<PosePair> pairs, double rotation_rad, double translation_m, uint64_t seed) {
  Rng rng(seed);
  for (PosePair& pair : pairs) {
    pair.camera_from_target = WithRobotNoise(pair.camera_from_target, rotation_rad, translation_m, rng);
  }
  return pairs;
}

TEST_P(HandEyeMethodTest, RecoversExactDataOfBothSetups) {
  for (const heba::Setup setup : {heba::Setup::kEyeToHand, heba::Setup::kEyeInHand}) {
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      TestSceneOptions options;
      options.setup = setup;
      const TestScene scene = SceneFor(GetParam(), seed, options);
      const Outcome<HandEye> found = Solve(scene.pairs);
      ASSERT_TRUE(found.ok()) << found.reason();
      EXPECT_THAT(found->camera_mount_from_camera,
                  IsNearPose(scene.hand_eye.camera_mount_from_camera, kRoundOff, kRoundOff))
          << "seed " << seed;
      EXPECT_THAT(found->target_mount_from_target,
                  IsNearPose(scene.hand_eye.target_mount_from_target, kRoundOff, kRoundOff))
          << "seed " << seed;
    }
  }
}

// A camera that is rotated by exactly 180 degrees relative to its mount is common, and a singularity of several
// parametrisations.
TEST_P(HandEyeMethodTest, RecoversRotationsBy180Degrees) {
  TestScene scene = SceneFor(GetParam(), 3);
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, 0, 1)}) {
    HandEye truth = scene.hand_eye;
    truth.camera_mount_from_camera = Rigid3d(ExpRotation(kPi * axis), Eigen::Vector3d(0.1, -0.2, 0));
    std::vector<PosePair> pairs = scene.pairs;
    for (PosePair& pair : pairs) {
      pair.camera_mount_from_target_mount = CameraMountFromTargetMount(truth, pair.camera_from_target);
    }
    const Outcome<HandEye> found = Solve(pairs);
    ASSERT_TRUE(found.ok()) << found.reason();
    EXPECT_THAT(found->camera_mount_from_camera, IsNearPose(truth.camera_mount_from_camera, kRoundOff, kRoundOff));
  }
}

TEST_P(HandEyeMethodTest, IsEquivariantToAChangeOfTheMountFrame) {
  const TestScene scene = SceneFor(GetParam(), 5);
  const Rigid3d new_mount_from_mount(ExpRotation({0.4, -1.1, 0.7}), Eigen::Vector3d(1.0, -2.0, 0.5));
  std::vector<PosePair> moved = scene.pairs;
  for (PosePair& pair : moved) {
    pair.camera_mount_from_target_mount = new_mount_from_mount * pair.camera_mount_from_target_mount;
  }
  const Outcome<HandEye> found = Solve(moved);
  ASSERT_TRUE(found.ok()) << found.reason();
  EXPECT_THAT(found->camera_mount_from_camera,
              IsNearPose(new_mount_from_mount * scene.hand_eye.camera_mount_from_camera, kRoundOff, kRoundOff));
  EXPECT_THAT(found->target_mount_from_target,
              IsNearPose(scene.hand_eye.target_mount_from_target, kRoundOff, kRoundOff));
}

TEST_P(HandEyeMethodTest, RefusesTooFewCaptures) {
  const TestScene scene = MakeTestScene(1);
  const Outcome<HandEye> found = Solve({scene.pairs[0], scene.pairs[1]});
  ASSERT_FALSE(found.ok());
  EXPECT_EQ(found.reason(), "few_captures (captures 2)");
}

TEST_P(HandEyeMethodTest, RefusesParallelAxesAndNoRotation) {
  const TestScene scene = MakeTestScene(1);
  Rng rng(7);
  for (const double max_turn_rad : {1.0, 0.0}) {
    std::vector<PosePair> pairs;
    for (int i = 0; i < 12; ++i) {
      const Rigid3d camera_from_target =
          scene.pairs[0].camera_from_target *
          Rigid3d{ExpRotation({0, 0, rng.Uniform(-1, 1) * max_turn_rad}), 0.1 * rng.NormalVector3()};
      pairs.push_back({CameraMountFromTargetMount(scene.hand_eye, camera_from_target), camera_from_target});
    }
    const Outcome<HandEye> found = Solve(pairs);
    ASSERT_FALSE(found.ok());
    EXPECT_EQ(found.failure().code, max_turn_rad > 0 ? "one_axis" : "no_rotation");
  }
}

// Nine times as many captures with the same noise reduce the error to a third. The median ratio of errors over the
// seeds has a spread of about 15 % here; the range [1/6, 1/1.5] is missed by chance far less than once in 10^4.
TEST_P(HandEyeMethodTest, ErrorFallsWithTheSquareRootOfTheNumberOfCaptures) {
  if (FindHandEyeMethod(GetParam())->motion == MethodMotion::kTwoStep) {
    GTEST_SKIP() << "its rotation comes from two translations, however many captures there are";
  }
  std::vector<double> ratios;
  for (uint64_t seed = 1; seed <= 15; ++seed) {
    double errors[2] = {0, 0};
    int k = 0;
    for (const int num_captures : {8, 72}) {
      TestSceneOptions options;
      options.num_captures = num_captures;
      const TestScene scene = SceneFor(GetParam(), seed, options);
      const Outcome<HandEye> found = Solve(WithNoise(scene.pairs, DegToRad(0.02), 0.0002, seed + 100));
      ASSERT_TRUE(found.ok()) << found.reason();
      errors[k++] = AngleRad(found->camera_mount_from_camera, scene.hand_eye.camera_mount_from_camera);
    }
    ratios.push_back(errors[1] / errors[0]);
  }
  std::nth_element(ratios.begin(), ratios.begin() + 7, ratios.end());
  EXPECT_GT(ratios[7], 1.0 / 6);
  EXPECT_LT(ratios[7], 1.0 / 1.5);
}

INSTANTIATE_TEST_SUITE_P(Table, HandEyeMethodTest, testing::ValuesIn(HandEyeMethodNames()),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace heba
