// An earlier session as an observation: heba/data/joint_prior.h, solvers/uncertainty/joint_prior_rows.h,
// solvers/refine/joint_prior_cost.h, solvers/calibration/prior_agreement.h.
#include "heba/data/joint_prior.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "heba/data/hand_eye.h"
#include "heba/refinement.h"
#include "solvers/calibration/prior_agreement.h"
#include "solvers/calibration/scale_share.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/uncertainty/joint_prior_rows.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

constexpr size_t kNumEarlier = 30;
constexpr size_t kNumLater = 4;

// The captures [first, last) of a scene, with free intrinsics.
Problem Captures(const TestScene& scene, Setup setup, size_t first, size_t last) {
  PairProblem problem{scene.camera,
                      {scene.views.begin() + static_cast<std::ptrdiff_t>(first),
                       scene.views.begin() + static_cast<std::ptrdiff_t>(last)},
                      setup};
  return HandEyeProblem(problem, BundleOptions());
}

AdjustmentOptions WithEstimatedNoise() {
  AdjustmentOptions options;
  options.robot = BundleOptions::Robot::kEstimatedNoise;
  return options;
}

double LeastPValue(const Problem& problem, const Solution& solution) {
  double least = 1;
  for (const PriorAgreement& agreement : AgreementWithPrior(problem, solution)) {
    least = std::min(least, agreement.p_value);
  }
  return least;
}

class JointPriorTest : public testing::TestWithParam<Setup> {
 protected:
  JointPriorTest() {
    scene_options_.setup = GetParam();
    scene_options_.num_captures = kNumEarlier + kNumLater;
    scene_options_.noise_px = 0.1;
    scene_options_.robot_translation_m = 2e-4;
    scene_options_.robot_rotation_rad = DegToRad(0.02);
    scene_ = MakeTestScene(5, scene_options_);
    start_ = HandEyePosesOf(scene_.hand_eye);
  }

  // The later captures, with the earlier ones as prior.
  Problem Later(const Problem& earlier, const Solution& solution, const ChangeOfCell& change = {}) const {
    Problem later = Captures(scene_, GetParam(), kNumEarlier, kNumEarlier + kNumLater);
    later.prior = std::make_shared<const JointPrior>(JointPriorOf(earlier, solution, later, change));
    return later;
  }

  TestSceneOptions scene_options_;
  TestScene scene_;
  CellPoses start_;
};

TEST_P(JointPriorTest, FourCapturesWithThirtyEarlierAreWorthThirtyFour) {
  const Problem earlier = Captures(scene_, GetParam(), 0, kNumEarlier);
  const Outcome<Solution> of_earlier = RefineProblem(earlier, start_, WithEstimatedNoise());
  ASSERT_TRUE(of_earlier) << of_earlier.reason();
  AdjustmentOptions options = WithEstimatedNoise();
  options.robot_noise_prior = RobotNoisePrior{*of_earlier->robot_noise[0], 0.15};
  const Problem later = Later(earlier, *of_earlier);
  const Outcome<Solution> updated = RefineProblem(later, of_earlier->poses, options);
  ASSERT_TRUE(updated) << updated.reason();
  const Outcome<Solution> of_all =
      RefineProblem(Captures(scene_, GetParam(), 0, kNumEarlier + kNumLater), start_, WithEstimatedNoise());
  ASSERT_TRUE(of_all) << of_all.reason();
  const Matrix6 covariance = *PoseCovarianceOf(of_all->covariance, kHandEyeBlock);
  const Matrix6 of_update = *PoseCovarianceOf(updated->covariance, kHandEyeBlock);
  const Tangent6 difference = LocalCoordinates(of_all->poses.mount_from_camera[0], updated->poses.mount_from_camera[0]);
  for (Eigen::Index i = 0; i < 6; ++i) {
    EXPECT_LT(std::abs(difference[i]), 0.2 * std::sqrt(covariance(i, i))) << i;
    EXPECT_NEAR(of_update(i, i) / covariance(i, i), 1, 0.1) << i;
  }
  EXPECT_GT(LeastPValue(later, *updated), 1e-3);
}

TEST_P(JointPriorTest, WithGivenNoiseNothingIsLost) {
  AdjustmentOptions options;
  options.robot = BundleOptions::Robot::kGivenNoise;
  options.robot_noise = {scene_options_.robot_translation_m, scene_options_.robot_rotation_rad, 0};
  options.pixel_noise_px = scene_options_.noise_px;
  options.loss = LossKind::kNone;
  const Problem earlier = Captures(scene_, GetParam(), 0, kNumEarlier);
  const Outcome<Solution> of_earlier = RefineProblem(earlier, start_, options);
  ASSERT_TRUE(of_earlier) << of_earlier.reason();
  const Outcome<Solution> updated = RefineProblem(Later(earlier, *of_earlier), of_earlier->poses, options);
  ASSERT_TRUE(updated) << updated.reason();
  const Outcome<Solution> of_all =
      RefineProblem(Captures(scene_, GetParam(), 0, kNumEarlier + kNumLater), start_, options);
  ASSERT_TRUE(of_all) << of_all.reason();
  const Matrix6 covariance = *PoseCovarianceOf(of_all->covariance, kHandEyeBlock);
  const Tangent6 difference = LocalCoordinates(of_all->poses.mount_from_camera[0], updated->poses.mount_from_camera[0]);
  // The prior is the earlier sum of squares up to its curvature.
  EXPECT_LT(std::sqrt(MahalanobisSquare(difference, covariance)), 0.02);
  EXPECT_NEAR(updated->covariance.matrix.trace() / of_all->covariance.matrix.trace(), 1, 0.01);
}

TEST_P(JointPriorTest, NoticesThatTheCameraHasMoved) {
  const Problem earlier = Captures(scene_, GetParam(), 0, kNumEarlier);
  const Outcome<Solution> of_earlier = RefineProblem(earlier, start_, WithEstimatedNoise());
  ASSERT_TRUE(of_earlier) << of_earlier.reason();
  Solution moved = *of_earlier;
  Tangent6 motion;
  motion << 2e-3, -1e-3, 1e-3, 0, DegToRad(0.2), 0;
  moved.poses.mount_from_camera[0] = Retract(moved.poses.mount_from_camera[0], motion);
  AdjustmentOptions options = WithEstimatedNoise();
  options.robot_noise_prior = RobotNoisePrior{*of_earlier->robot_noise[0], 0.15};
  const Problem contradicted = Later(earlier, moved);
  const Outcome<Solution> wrong = RefineProblem(contradicted, moved.poses, options);
  ASSERT_TRUE(wrong) << wrong.reason();
  EXPECT_LT(LeastPValue(contradicted, *wrong), 1e-4);
  // A change that is stated is none.
  const Problem told = Later(earlier, moved, {2e-3, DegToRad(0.2), false});
  const Outcome<Solution> right = RefineProblem(told, moved.poses, options);
  ASSERT_TRUE(right) << right.reason();
  EXPECT_GT(LeastPValue(told, *right), 1e-3);
}

TEST_P(JointPriorTest, ATargetThatWasMovedIsNotPartOfIt) {
  const Problem earlier = Captures(scene_, GetParam(), 0, kNumEarlier);
  const Outcome<Solution> of_earlier = RefineProblem(earlier, start_, WithEstimatedNoise());
  ASSERT_TRUE(of_earlier) << of_earlier.reason();
  const Problem later = Later(earlier, *of_earlier, {0, 0, true});
  EXPECT_EQ(later.prior->covariance.layout.Block(kBoardBlock).size, 0);
  EXPECT_EQ(later.prior->covariance.layout.Block(kHandEyeBlock).size, 6);
}

TEST_P(JointPriorTest, ItsRowsAreDifferentiated) {
  const Problem earlier = Captures(scene_, GetParam(), 0, kNumEarlier);
  const Outcome<Solution> solution = RefineProblem(earlier, start_, WithEstimatedNoise());
  ASSERT_TRUE(solution) << solution.reason();
  const Problem later = Later(earlier, *solution);
  FitState state = StateOf(*solution);
  Tangent6 step;
  step << 0.03, -0.02, 0.01, 0.2, -0.3, 0.1;
  state.poses.mount_from_camera[0] = Retract(state.poses.mount_from_camera[0], step);
  const UnknownLayout layout = UnknownsOf(later);
  const JointPriorRows rows = RowsOf(*later.prior, layout, ValuesOf(state));
  const UnknownBlock pose = layout.Block(kHandEyeBlock);
  constexpr double kStep = 1e-6;
  for (Eigen::Index i = 0; i < 6; ++i) {
    const auto at = [&](double size) {
      FitState moved = state;
      moved.poses.mount_from_camera[0] = Retract(state.poses.mount_from_camera[0], size * Tangent6(Tangent6::Unit(i)));
      return RowsOf(*later.prior, layout, ValuesOf(moved)).residuals;
    };
    const Eigen::VectorXd by_step = (at(kStep) - at(-kStep)) / (2 * kStep);
    EXPECT_LT((by_step - rows.by_unknowns.col(pose.first + i)).norm(), 1e-5 * by_step.norm()) << i;
  }
}

// The share that all sessions have in common is not averaged: it is as large after the update as before.
TEST_P(JointPriorTest, TheShareOfScalesStays) {
  const Problem earlier = Captures(scene_, GetParam(), 0, kNumEarlier);
  Outcome<Solution> of_earlier = RefineProblem(earlier, start_, WithEstimatedNoise());
  ASSERT_TRUE(of_earlier) << of_earlier.reason();
  ScaleSigmas sigmas;
  sigmas.targets = {kTargetScaleSigma};
  sigmas.robots = {kRobotScaleSigma};
  of_earlier = WithShare(*of_earlier, ShareOfScales(earlier, *of_earlier, sigmas), {}, {});
  const Problem later = Later(earlier, *of_earlier);
  AdjustmentOptions options = WithEstimatedNoise();
  options.robot_noise_prior = RobotNoisePrior{*of_earlier->robot_noise[0], 0.15};
  Outcome<Solution> updated = RefineProblem(later, of_earlier->poses, options);
  ASSERT_TRUE(updated) << updated.reason();
  updated = WithShare(*updated, ShareOfScales(later, *updated, sigmas), {}, {});
  const auto share_of = [](const Solution& solution) {
    return Matrix6(*PoseCovarianceOf(solution.covariance, kHandEyeBlock) -
                   *PoseCovarianceOf(solution.covariance_repeatable, kHandEyeBlock));
  };
  EXPECT_GT(share_of(*of_earlier).trace(), 0);
  EXPECT_NEAR(share_of(*updated).trace() / share_of(*of_earlier).trace(), 1, 1e-3);
}

INSTANTIATE_TEST_SUITE_P(Setups, JointPriorTest, testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                         [](const auto& setup) { return std::string(SetupName(setup.param)); });

}  // namespace
}  // namespace heba
