#include "solvers/influence.h"

#include <gtest/gtest.h>

#include "solvers/bundle_adjustment.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

struct Case {
  const char* name;
  BundleOptions::Robot robot;
  double robot_translation_m;
  double robot_rotation_rad;
};

class InfluenceTest : public testing::TestWithParam<Case> {};

Outcome<Solution> Solve(const TestScene& scene, const std::vector<View>& views, BundleOptions options) {
  return RefineHandEye({scene.camera, views}, scene.hand_eye, options);
}

// Leaving a capture out for real is the truth. The prediction takes one step, with the noise held: it is exact but for
// what is of second order in the noise, which is small here.
TEST_P(InfluenceTest, IsWhatLeavingTheCaptureOutDoes) {
  TestSceneOptions scene_options;
  scene_options.num_captures = 12;
  scene_options.noise_px = 0.06;
  scene_options.robot_translation_m = GetParam().robot_translation_m;
  scene_options.robot_rotation_rad = GetParam().robot_rotation_rad;
  const TestScene scene = MakeTestScene(11, scene_options);
  BundleOptions options;
  options.loss = "none";
  options.pixel_noise_px = 0.06;
  options.robot = GetParam().robot;
  options.robot_noise = {GetParam().robot_translation_m, GetParam().robot_rotation_rad};
  const Outcome<Solution> all = Solve(scene, scene.views, options);
  ASSERT_TRUE(all.ok()) << all.reason();
  const std::vector<std::optional<Tangent6>> moves =
      MoveWithoutEachView({scene.camera, scene.views}, *all, FreeOf(scene.camera.Model(), options));
  ASSERT_EQ(moves.size(), scene.views.size());
  for (size_t i = 0; i < scene.views.size(); ++i) {
    std::vector<View> others = scene.views;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const Outcome<Solution> without = Solve(scene, others, options);
    ASSERT_TRUE(without.ok()) << without.reason();
    const Tangent6 moved =
        LocalCoordinates(all->hand_eye.camera_mount_from_camera, without->hand_eye.camera_mount_from_camera);
    ASSERT_TRUE(moves[i]);
    EXPECT_LT((moves[i]->head<3>() - moved.head<3>()).norm(), 0.05 * moved.head<3>().norm()) << i;
    EXPECT_LT((moves[i]->tail<3>() - moved.tail<3>()).norm(), 0.05 * moved.tail<3>().norm()) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(, InfluenceTest,
                         testing::Values(Case{"ExactRobot", BundleOptions::Robot::kExact, 0, 0},
                                         Case{"NoisyRobot", BundleOptions::Robot::kGivenNoise, 1e-4, 2e-4}),
                         [](const auto& test) { return test.param.name; });

TEST(InfluenceOfFewTest, SaysNothingOfACaptureThatTheOthersCannotDoWithout) {
  TestSceneOptions scene_options;
  scene_options.num_captures = 3;
  scene_options.noise_px = 0.1;
  const TestScene scene = MakeTestScene(5, scene_options);
  BundleOptions options;
  options.loss = "none";
  options.free_intrinsics = {};
  const Outcome<Solution> all = Solve(scene, scene.views, options);
  ASSERT_TRUE(all.ok()) << all.reason();
  for (const std::optional<Tangent6>& move :
       MoveWithoutEachView({scene.camera, scene.views}, *all, FreeOf(scene.camera.Model(), options))) {
    EXPECT_FALSE(move);
  }
}

}  // namespace
}  // namespace heba
