#include "solvers/study/study.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "solvers/study/study_captures.h"
#include "tests/support/study_cells.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::SizeIs;

TEST(StudyPosesTest, NamesThePosesOfCamerasBetweenThemAndOfBases) {
  EXPECT_THAT(StudiedPoses(CellOf(MixedCell(1))),
              ElementsAre("camera left in base", "camera right in base", "camera wrist in gripper",
                          "camera right in camera left"));
  EXPECT_THAT(StudiedPoses(CellOf(TwoArmCell(1))), ElementsAre("camera top in world", "arm right in arm left"));
}

// The captures of a trial without noise are exact, so that both estimators find the truth.
TEST(StudyPosesTest, EstimatorsFindTheTruthWithoutNoise) {
  StudyCell cell = CellOf(MixedCell(1));
  cell.pixel_sigma_px = 0;
  cell.robot_noise = {};
  const std::vector<std::vector<TrialEstimate>> estimates = RunTrial(cell, 1, 0);
  ASSERT_THAT(estimates, SizeIs(4));
  for (const std::vector<TrialEstimate>& of_pose : estimates) {
    ASSERT_THAT(of_pose, SizeIs(2));
    EXPECT_EQ(of_pose[0].method, "jointly");
    EXPECT_EQ(of_pose[1].method, "one_by_one");
    for (const TrialEstimate& estimate : of_pose) {
      ASSERT_TRUE(estimate.ok);
      constexpr double kConverged = 1e-6;  // m and rad.
      EXPECT_LT(estimate.error.norm(), kConverged) << estimate.method;
    }
  }
}

// Captures at one pose differ in their pixels only.
TEST(StudyPosesTest, RepeatedCapturesShareTheErrorsOfTheArms) {
  StudyCell cell = CellOf(TwoArmCell(1));
  cell.num_repeats = 3;
  cell.wrong_captures = 0.5;
  Rng rng(1);
  const Problem problem = SimulateProblem(cell, rng);
  ASSERT_THAT(problem.captures, SizeIs(3 * cell.captures.size()));
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    const ProblemCapture& first = problem.captures[i - i % 3];
    const ProblemCapture& capture = problem.captures[i];
    for (size_t r = 0; r < 2; ++r) {
      EXPECT_EQ(capture.base_from_gripper[r].translation, first.base_from_gripper[r].translation);
    }
    if (i % 3 == 0) continue;
    EXPECT_NE(capture.images.at(0).observations.pixels, first.images.at(0).observations.pixels);
  }
}

TEST(StudyPosesTest, DisplacesTheShareOfPointsAndPosesThatTheCellStates) {
  StudyCell cell = CellOf(MixedCell(1));
  cell.pixel_sigma_px = 0;
  cell.robot_noise = {};
  const Problem exact = ExactProblem(cell);
  cell.outlier_points = 0.1;
  cell.wrong_captures = 0.3;
  Rng rng(1);
  const Problem problem = SimulateProblem(cell, rng);
  double num_points = 0;
  double num_displaced = 0;
  double num_wrong = 0;
  for (size_t i = 0; i < exact.captures.size(); ++i) {
    const ProblemCapture& capture = problem.captures[i];
    const double step_m =
        (capture.base_from_gripper[0].translation - exact.captures[i].base_from_gripper[0].translation).norm();
    num_wrong += step_m > 1e-9 ? 1 : 0;
    ASSERT_EQ(capture.images.size(), exact.captures[i].images.size());
    for (size_t k = 0; k < capture.images.size(); ++k) {
      const Points2 steps = capture.images[k].observations.pixels - exact.captures[i].images[k].observations.pixels;
      num_points += static_cast<double>(steps.cols());
      num_displaced += static_cast<double>((steps.colwise().norm().array() > 1e-9).count());
    }
  }
  EXPECT_NEAR(num_displaced / num_points, 0.1, 0.03);
  EXPECT_NEAR(num_wrong / static_cast<double>(exact.captures.size()), 0.3, 0.25);
}

// The estimators know the design only, and find the size of the targets from the poses of the arm.
TEST(StudyPosesTest, TargetsMayDifferFromTheirDesign) {
  StudyCell cell = CellOf(MixedCell(1));
  const auto designed = ErrorBounds(cell);
  cell.shape_params = {1.01, 1.01, 0, 0};
  cell.options.choose.target_shape = true;
  cell.estimators = {StudyEstimator::kJointly};
  const auto bounds = ErrorBounds(cell);
  ASSERT_TRUE(designed && bounds);
  EXPECT_GT(bounds->at(0).errors.hand_eye_m, designed->at(0).errors.hand_eye_m);
  const std::vector<std::vector<TrialEstimate>> estimates = RunTrial(cell, 1, 0);
  for (size_t i = 0; i < estimates.size(); ++i) {
    ASSERT_TRUE(estimates[i].at(0).ok);
    EXPECT_LT(estimates[i][0].error.head<3>().norm(), 3 * bounds->at(i).errors.hand_eye_m) << i;
  }
}

// A rig of one camera has nothing to gain: both estimators see the same images.
TEST(StudyPosesTest, OneCameraIsTheSameByItself) {
  const std::vector<std::vector<TrialEstimate>> estimates = RunTrial(CellOf(TwoArmCell(2)), 1, 3);
  ASSERT_THAT(estimates, SizeIs(2));
  for (const std::vector<TrialEstimate>& of_pose : estimates) {
    ASSERT_THAT(of_pose, SizeIs(2));
    ASSERT_TRUE(of_pose[0].ok && of_pose[1].ok);
    EXPECT_EQ(of_pose[0].error, of_pose[1].error);
    EXPECT_EQ(of_pose[0].is_covered, of_pose[1].is_covered);
  }
}

// A fixed camera that sees a target on the second arm only has, by itself, no pose in the base of the first one.
TEST(StudyPosesTest, APoseThatNeedsOtherCamerasHasNoEstimateByItself) {
  const CellSceneSetting setting;
  CellScene scene = TwoArmCell(1, setting);
  AddCamera("side", {0, Mount::Part::kBase}, LookingAt({0.9, 0.6, 0.9}, {0.55, 0, 0.4}, 0), setting, &scene);
  StudyCell cell = CellOf(scene, setting);
  ASSERT_THAT(StudiedPoses(cell), ElementsAre("camera top in world", "camera side in world",
                                              "camera side in camera top", "arm right in arm left"));
  Rng rng(1);
  const Problem all = SimulateProblem(cell, rng);
  // The captures in which the new camera sees the target of the second arm only.
  cell.captures.clear();
  for (size_t i = 0; i < all.captures.size(); ++i) {
    bool sees_first = false;
    for (const ProblemImage& image : all.captures[i].images) {
      sees_first = sees_first || (image.camera == 1 && image.target == 0);
    }
    if (!sees_first) cell.captures.push_back({{}, scene.arms[i]});
  }
  const std::vector<std::vector<TrialEstimate>> estimates = RunTrial(cell, 1, 0);
  EXPECT_THAT(estimates[0], SizeIs(2));
  EXPECT_THAT(estimates[1], SizeIs(1));
  EXPECT_EQ(estimates[1].at(0).method, "jointly");
  EXPECT_THAT(estimates[2], SizeIs(1));
  EXPECT_THAT(estimates[3], SizeIs(2));
}

// The covariance is quadratic in the noise, and more captures can only lower it.
TEST(StudyPosesTest, TheBoundScalesWithTheNoise) {
  StudyCell cell = CellOf(MixedCell(1));
  const auto bound = ErrorBounds(cell);
  ASSERT_TRUE(bound) << bound.reason();
  ASSERT_THAT(*bound, SizeIs(4));
  StudyCell noisy = cell;
  noisy.pixel_sigma_px *= 2;
  noisy.robot_noise.translation_m *= 2;
  noisy.robot_noise.rotation_rad *= 2;
  const auto doubled = ErrorBounds(noisy);
  cell.captures.resize(15);
  const auto fewer = ErrorBounds(cell);
  ASSERT_TRUE(doubled && fewer);
  constexpr double kNumeric = 1e-6;
  for (size_t i = 0; i < bound->size(); ++i) {
    const Eigen::MatrixXd& covariance = (*bound)[i].covariance;
    EXPECT_LT(((*doubled)[i].covariance / 4 - covariance).norm(), kNumeric * covariance.norm());
    EXPECT_GT((*fewer)[i].covariance.trace(), covariance.trace());
  }
}

TEST(StudyPosesTest, SaysWhyThereIsNoBound) {
  StudyCell cell = CellOf(MixedCell(1));
  cell.captures.resize(1);
  EXPECT_FALSE(ErrorBounds(cell).ok());
  cell.captures.clear();
  EXPECT_EQ(ErrorBounds(cell).failure().code, "no_target_in_view");
}

// 40 trials: the squared error of a pose in units of its bound is chi-square of 240 degrees of freedom if the estimate
// is efficient, whose 99.99 % range is 0.66 to 1.40 of its mean; the number of covered poses is at least 32 of 40 with
// a probability of 0.9999.
TEST(StudyPosesTest, ReachesTheBoundAndGainsBetweenCameras) {
  CellSceneSetting setting;
  setting.has_free_intrinsics = false;
  const StudyCell cell = CellOf(FourCameraCell(1, setting), setting);
  constexpr int kNumTrials = 40;
  std::vector<std::vector<std::vector<TrialEstimate>>> trials;
  for (int trial = 0; trial < kNumTrials; ++trial) trials.push_back(RunTrial(cell, 1, trial));
  const auto bound = ErrorBounds(cell);
  ASSERT_TRUE(bound);
  const std::vector<PoseSummary> summaries = Summarise(cell, trials);
  ASSERT_THAT(summaries, SizeIs(10));
  for (size_t i = 0; i < summaries.size(); ++i) {
    const PoseSummary& summary = summaries[i];
    double squares = 0;
    for (const auto& trial : trials) {
      const Eigen::VectorXd& error = trial[i].at(0).error;
      squares += MahalanobisSquare(error, (*bound)[i].covariance);
    }
    EXPECT_GT(squares / (6 * kNumTrials), 0.66) << summary.pose;
    EXPECT_LT(squares / (6 * kNumTrials), 1.40) << summary.pose;
    ASSERT_THAT(summary.methods, SizeIs(2));
    EXPECT_EQ(summary.methods[0].num_failed, 0);
    EXPECT_GE(*summary.methods[0].coverage, 32.0 / kNumTrials) << summary.pose;
    EXPECT_NEAR(summary.bound->hand_eye_m, std::sqrt((*bound)[i].covariance.topLeftCorner<3, 3>().trace()), 1e-12);
    EXPECT_FALSE(summary.bound->board_m.has_value());
    // All cameras share the errors of the arm, which cancel between them in the joint estimate only.
    if (summary.pose.find(" in camera ") == std::string::npos) continue;
    EXPECT_GT(summary.methods[1].rms.hand_eye_m, 2 * summary.methods[0].rms.hand_eye_m) << summary.pose;
  }
}

}  // namespace
}  // namespace heba
