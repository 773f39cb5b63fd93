#include "solvers/initial/target_pose.h"

#include <string>
#include <tuple>

#include <gtest/gtest.h>

#include "heba/camera/camera_model.h"
#include "heba/geometry/pose_block.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/initial/pose_selection.h"
#include "tests/support/matchers.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

TEST(TargetPoseTest, IsExactForEveryCameraModel) {
  for (const std::string& model : CameraModelNames()) {
    TestSceneOptions options;
    options.camera = TestCamera(model);
    const TestScene scene = MakeTestScene(11, options);
    for (size_t i = 0; i < scene.views.size(); ++i) {
      const std::vector<TargetPose> poses = EstimateTargetPose(scene.camera, scene.views[i].observations);
      ASSERT_FALSE(poses.empty()) << model;
      // 1e-6 rad and m: the fit stops when its cost, at 1e-9 px, no longer decreases.
      EXPECT_THAT(poses.front().camera_from_target, IsNearPose(scene.pairs[i].camera_from_target, 1e-6, 1e-6)) << model;
    }
  }
}

TEST(TargetPoseTest, KeepsBothMinimaOfASmallTarget) {
  TestSceneOptions options;
  options.points = GridPoints(2, 2, 0.04);
  options.noise_px = 0.1;
  options.num_captures = 60;
  const TestScene scene = MakeTestScene(12, options);
  int both = 0;
  int right = 0;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const std::vector<TargetPose> poses = EstimateTargetPose(scene.camera, scene.views[i].observations);
    ASSERT_FALSE(poses.empty());
    both += poses.size() == 2 ? 1 : 0;
    double best_deg = 180;
    for (const TargetPose& pose : poses) {
      best_deg = std::min(best_deg, RadToDeg(AngleRad(pose.camera_from_target, scene.pairs[i].camera_from_target)));
    }
    right += best_deg < 10 ? 1 : 0;  // The tolerance allows for noise in the tilt of a 60 px target.
  }
  EXPECT_GT(both, 30);
  EXPECT_GE(right, 58);
}

// The parameters are the number of points per side of the target and the ratio of the camera's focal length to the true
// one. Small targets have two similar minima.
class RoughPoseTest : public testing::TestWithParam<std::tuple<int, double>> {};

TEST_P(RoughPoseTest, IsNearTheBestMinimum) {
  const auto& [points_per_side, focal_factor] = GetParam();
  TestSceneOptions options;
  options.points = GridPoints(points_per_side, points_per_side, 0.04);
  options.noise_px = 0.3;
  options.num_captures = 60;
  const TestScene scene = MakeTestScene(14, options);
  Camera camera = scene.camera;
  camera.params[0] *= focal_factor;
  camera.params[1] *= focal_factor;
  for (const View& view : scene.views) {
    const std::vector<TargetPose> poses = EstimateTargetPose(camera, view.observations);
    const std::optional<TargetPose> rough = EstimateRoughPose(camera, view.observations);
    ASSERT_FALSE(poses.empty());
    ASSERT_TRUE(rough.has_value());
    EXPECT_LT(rough->rms_px, 1.01 * poses.front().rms_px + 1e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(, RoughPoseTest, testing::Combine(testing::Values(2, 7), testing::Values(1.0, 0.5)),
                         [](const auto& test) {
                           return std::to_string(std::get<int>(test.param)) + "_points_per_side_" +
                                  (std::get<double>(test.param) == 1 ? "right" : "half_the") + "_focal_length";
                         });

TEST(TargetPoseTest, ReturnsNothingForTooFewOrCollinearPoints) {
  TestSceneOptions options;
  options.points = GridPoints(3, 1, 0.04);
  const TestScene three = MakeTestScene(1, options);
  EXPECT_TRUE(EstimateTargetPose(three.camera, three.views[0].observations).empty());
  EXPECT_FALSE(EstimateRoughPose(three.camera, three.views[0].observations));
  options.points = GridPoints(6, 1, 0.04);
  const TestScene line = MakeTestScene(1, options);
  EXPECT_TRUE(EstimateTargetPose(line.camera, line.views[0].observations).empty());
}

// A third of the views begin with the wrong one of the two minima; the consistency of the chain identifies all of
// them.
TEST(ChoosePosesTest, RejectsTheWrongMinimum) {
  TestSceneOptions options;
  options.points = GridPoints(2, 2, 0.06);
  options.noise_px = 0.05;
  const TestScene scene = MakeTestScene(13, options);
  std::vector<std::vector<TargetPose>> poses;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    poses.push_back(EstimateTargetPose(scene.camera, scene.views[i].observations));
    ASSERT_FALSE(poses.back().empty());
    if (i % 3 == 0 && poses.back().size() == 2) std::swap(poses.back()[0], poses.back()[1]);
  }
  const ChosenPoses chosen = ChoosePoses(scene.camera, scene.views, poses, {Rigid3d()});
  for (size_t i = 0; i < scene.views.size(); ++i) {
    EXPECT_LT(RadToDeg(AngleRad(chosen.pairs[i].camera_from_target, scene.pairs[i].camera_from_target)), 5.0) << i;
  }
  // The returned solutions of the methods are those for the chosen pairs.
  ASSERT_EQ(chosen.solutions.size(), HandEyeMethods().size());
  int num_known = 0;
  for (size_t m = 0; m < HandEyeMethods().size(); ++m) {
    const std::optional<Outcome<HandEye>>& known = chosen.solutions[m];
    if (!known) continue;
    ++num_known;
    const Outcome<HandEye> solved = HandEyeMethods()[m].solve(HandEyeInput(chosen.pairs));
    ASSERT_EQ(known->ok(), solved.ok()) << HandEyeMethods()[m].name;
    if (!solved.ok()) continue;
    EXPECT_EQ(ToBlock((*known)->camera_mount_from_camera), ToBlock(solved->camera_mount_from_camera));
    EXPECT_EQ(ToBlock((*known)->target_mount_from_target), ToBlock(solved->target_mount_from_target));
  }
  EXPECT_GT(num_known, 0);
}

// The target looks the same after a rotation by 180 deg and was read upside down in every second view.
TEST(ChoosePosesTest, FindsTheOrderOfASymmetricTarget) {
  TestSceneOptions options;
  options.noise_px = 0.1;
  TestScene scene = MakeTestScene(14, options);
  const Rigid3d half_turn(ExpRotation({0, 0, kPi}), Eigen::Vector3d::Zero());
  std::vector<std::vector<TargetPose>> poses;
  std::vector<int> expected;
  for (size_t i = 0; i < scene.views.size(); ++i) {
    const bool reversed = i % 2 == 1;
    if (reversed) {
      Points3& points = scene.views[i].observations.points_in_target;
      points = (half_turn.RotationMatrix() * points).eval();
    }
    expected.push_back(reversed ? 1 : 0);
    poses.push_back(EstimateTargetPose(scene.camera, scene.views[i].observations));
  }
  const ChosenPoses chosen = ChoosePoses(scene.camera, scene.views, poses, {Rigid3d(), half_turn});
  // All views may be consistently reversed, because the target's own frame is a convention.
  const int flip = chosen.symmetry[0] ^ expected[0];
  for (size_t i = 0; i < scene.views.size(); ++i) EXPECT_EQ(chosen.symmetry[i], expected[i] ^ flip) << i;
}

}  // namespace
}  // namespace heba
