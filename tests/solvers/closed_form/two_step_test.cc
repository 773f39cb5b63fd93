// Tests of the two-step method and its weighted form: they equal the paper's formulas on the paper's motion, roles
// are found from the motion itself, and missing captures are named.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/two_step_motion.h"
#include "solvers/initial/target_pose.h"
#include "tests/support/matchers.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

TestScene PaperScene(uint64_t seed, Setup setup, double noise_px = 0) {
  TestSceneOptions options;
  options.setup = setup;
  options.motion = TestSceneOptions::Motion::kTwoStep;
  options.points = GridPoints(2, 2, 0.04);
  options.noise_px = noise_px;
  return MakeTestScene(seed, options);
}

class TwoStepTest : public testing::TestWithParam<Setup> {};

// The reference is an independent implementation of Section 1 of the paper, line by line, for a robot that moves
// along the axes of the tool.
TEST_P(TwoStepTest, EqualsThePapersFormulas) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const TestScene scene = PaperScene(seed, GetParam());
    const Outcome<HandEye> found = FindHandEyeMethod("two_step")->solve(scene.pairs);
    ASSERT_TRUE(found.ok()) << found.reason();
    constexpr double kRoundOff = 1e-9;  // rad and m
    EXPECT_THAT(found->camera_mount_from_camera,
                IsNearPose(scene.hand_eye.camera_mount_from_camera, kRoundOff, kRoundOff));
    EXPECT_THAT(found->target_mount_from_target,
                IsNearPose(scene.hand_eye.target_mount_from_target, kRoundOff, kRoundOff));
    if (GetParam() != Setup::kEyeToHand) continue;
    // Captures 0, 1 and 2 are home and the translations along the axes of the tool; the sign is that of the robot's
    // motion.
    const auto seen = [&](size_t i) { return scene.pairs[i].camera_from_target.translation; };
    const Rigid3d home_from_base = Inverse(scene.pairs[0].camera_mount_from_target_mount);
    const auto moved = [&](size_t i) {
      return (home_from_base * scene.pairs[i].camera_mount_from_target_mount).translation;
    };
    Eigen::Matrix3d camera_from_tool;
    camera_from_tool.col(0) = std::copysign(1.0, moved(1).x()) * (seen(1) - seen(0)).normalized();
    camera_from_tool.col(1) = std::copysign(1.0, moved(2).y()) * (seen(2) - seen(0)).normalized();
    camera_from_tool.col(2) = camera_from_tool.col(0).cross(camera_from_tool.col(1));
    const Eigen::Matrix3d tool_from_camera = NearestRotation(camera_from_tool).transpose();
    // Equation (9), with its right-hand side from (10), is solved over all rotations; the translation follows.
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (size_t i = 3; i < scene.pairs.size(); ++i) {
      const Eigen::Matrix3d turn = (home_from_base * scene.pairs[i].camera_mount_from_target_mount).RotationMatrix() -
                                   Eigen::Matrix3d::Identity();
      normal += turn.transpose() * turn;
      right += turn.transpose() * (tool_from_camera * (seen(i) - seen(0)));
    }
    const Eigen::Vector3d board_in_tool = normal.inverse() * right;
    const Rigid3d tool_from_camera_pose(tool_from_camera, board_in_tool - tool_from_camera * seen(0));
    EXPECT_THAT(found->camera_mount_from_camera,
                IsNearPose(Inverse(home_from_base) * tool_from_camera_pose, kRoundOff, kRoundOff));
  }
}

TEST_P(TwoStepTest, FindsRolesFromTheMotion) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    TestScene scene = PaperScene(seed, GetParam());
    // A free capture is added, and home is not the first capture.
    const TestScene other = MakeTestScene(seed, {.setup = GetParam()});
    scene.views.push_back(other.views[4]);
    std::swap(scene.views[0], scene.views[5]);
    std::vector<CaptureRole> expected;
    for (View& view : scene.views) {
      expected.push_back(view.role == CaptureRole::kNone ? CaptureRole::kFree : view.role);
      view.role = CaptureRole::kNone;
    }
    EXPECT_EQ(FindTwoStepRoles(GetParam(), scene.views), expected) << "seed " << seed;
    EXPECT_THAT(FindTwoStepRoles(GetParam(), other.views), testing::Each(CaptureRole::kNone));
  }
}

TEST_P(TwoStepTest, NamesMissingCaptures) {
  const TestScene scene = PaperScene(1, GetParam());
  const auto reason_without = [&](CaptureRole role, size_t keep) {
    std::vector<PosePair> pairs;
    for (const PosePair& pair : scene.pairs) {
      const bool is_it = pair.role == role;
      pairs.push_back(pair);
      if (is_it && keep == 0) pairs.back().role = CaptureRole::kFree;
      if (is_it && keep > 0) --keep;
    }
    const Outcome<HandEye> found = FindHandEyeMethod("two_step")->solve(pairs);
    return found ? std::string("no failure") : found.reason();
  };
  EXPECT_THAT(reason_without(CaptureRole::kHome, 0), "no_home");
  EXPECT_THAT(reason_without(CaptureRole::kTranslateX, 0), "no_translation (axis x)");
  EXPECT_THAT(reason_without(CaptureRole::kTranslateY, 0), "no_translation (axis y)");
  EXPECT_THAT(reason_without(CaptureRole::kRotate, 1), testing::StartsWith("few_rotations (rotations 1, "));
}

// Depth is the least certain coordinate of a small target. Weighted by their covariances, the positions give a far
// more accurate estimate than the paper's formulas, and the estimate does not depend on the estimated orientation of
// the target.
TEST_P(TwoStepTest, WeightsImproveTheEstimateRegardlessOfOrientations) {
  double paper_m2 = 0;
  double weighted_m2 = 0;
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    TestScene scene = PaperScene(seed, GetParam(), 0.1);
    std::vector<PosePair> pairs;
    for (const View& view : scene.views) {
      // If the pose has two minima, the wrong one is used.
      const TargetPose pose = EstimateTargetPose(scene.camera, view.observations).back();
      pairs.push_back(
          {view.camera_mount_from_target_mount, pose.camera_from_target, view.role, pose.covariance_at_1px});
    }
    const Outcome<HandEye> paper = FindHandEyeMethod("two_step")->solve(pairs);
    const Outcome<HandEye> weighted = FindHandEyeMethod("two_step_ls")->solve(pairs);
    ASSERT_TRUE(paper.ok()) << paper.reason();
    ASSERT_TRUE(weighted.ok()) << weighted.reason();
    paper_m2 += std::pow(DistanceM(paper->camera_mount_from_camera, scene.hand_eye.camera_mount_from_camera), 2);
    weighted_m2 += std::pow(DistanceM(weighted->camera_mount_from_camera, scene.hand_eye.camera_mount_from_camera), 2);
  }
  EXPECT_LT(std::sqrt(weighted_m2), 0.4 * std::sqrt(paper_m2));
  RecordProperty("paper_over_weighted", std::to_string(std::sqrt(paper_m2 / weighted_m2)));
}

INSTANTIATE_TEST_SUITE_P(Setups, TwoStepTest, testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                         [](const auto& test) { return std::string(SetupName(test.param)); });

}  // namespace
}  // namespace heba
