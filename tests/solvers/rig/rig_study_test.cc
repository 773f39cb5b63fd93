#include "solvers/rig/rig_study.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "tests/support/rig_study_cells.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::SizeIs;

TEST(RigStudyTest, NamesThePosesOfCamerasBetweenThemAndOfBases) {
  EXPECT_THAT(StudiedRigPoses(CellOf(MixedRig(1))),
              ElementsAre("camera left in base", "camera right in base", "camera wrist in gripper",
                          "camera right in camera left"));
  EXPECT_THAT(StudiedRigPoses(CellOf(TwoArmRig(1))), ElementsAre("camera top in world", "arm right in arm left"));
}

// The captures of a trial without noise are exact, so that both estimators find the truth.
TEST(RigStudyTest, EstimatorsFindTheTruthWithoutNoise) {
  RigStudyCell cell = CellOf(MixedRig(1));
  cell.simulation.noise_px = 0;
  cell.simulation.robot_noise = {};
  const std::vector<std::vector<TrialEstimate>> estimates = RunRigTrial(cell, 1, 0);
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

// A rig of one camera has nothing to gain: both estimators see the same images.
TEST(RigStudyTest, OneCameraIsTheSameByItself) {
  const std::vector<std::vector<TrialEstimate>> estimates = RunRigTrial(CellOf(TwoArmRig(2)), 1, 3);
  ASSERT_THAT(estimates, SizeIs(2));
  for (const std::vector<TrialEstimate>& of_pose : estimates) {
    ASSERT_THAT(of_pose, SizeIs(2));
    ASSERT_TRUE(of_pose[0].ok && of_pose[1].ok);
    EXPECT_EQ(of_pose[0].error, of_pose[1].error);
    EXPECT_EQ(of_pose[0].is_covered, of_pose[1].is_covered);
  }
}

// A fixed camera that sees a target on the second arm only has, by itself, no pose in the base of the first one.
TEST(RigStudyTest, APoseThatNeedsOtherCamerasHasNoEstimateByItself) {
  const RigSceneSetting setting;
  RigScene scene = TwoArmRig(1, setting);
  AddCamera("side", {0, Mount::Part::kBase}, LookingAt({0.9, 0.6, 0.9}, {0.55, 0, 0.4}, 0), setting, &scene);
  RigStudyCell cell = CellOf(scene, setting);
  ASSERT_THAT(StudiedRigPoses(cell), ElementsAre("camera top in world", "camera side in world",
                                                 "camera side in camera top", "arm right in arm left"));
  Rng rng(1);
  const RigProblem all = [&] {
    RigProblem problem = cell.rig;
    problem.captures = SimulateCaptures(cell.rig, cell.poses, cell.targets, cell.arms, cell.simulation, &rng);
    return problem;
  }();
  // The captures in which the new camera sees the target of the second arm only.
  cell.arms.clear();
  for (size_t i = 0; i < all.captures.size(); ++i) {
    bool sees_first = false;
    for (const RigImage& image : all.captures[i].images) {
      sees_first = sees_first || (image.camera == 1 && image.target == 0);
    }
    if (!sees_first) cell.arms.push_back(scene.arms[i]);
  }
  const std::vector<std::vector<TrialEstimate>> estimates = RunRigTrial(cell, 1, 0);
  EXPECT_THAT(estimates[0], SizeIs(2));
  EXPECT_THAT(estimates[1], SizeIs(1));
  EXPECT_EQ(estimates[1].at(0).method, "jointly");
  EXPECT_THAT(estimates[2], SizeIs(1));
  EXPECT_THAT(estimates[3], SizeIs(2));
}

// The covariance is quadratic in the noise, and more captures can only lower it.
TEST(RigStudyTest, TheBoundScalesWithTheNoise) {
  RigStudyCell cell = CellOf(MixedRig(1));
  const auto bound = RigErrorBound(cell);
  ASSERT_TRUE(bound) << bound.reason();
  ASSERT_THAT(*bound, SizeIs(4));
  RigStudyCell noisy = cell;
  noisy.simulation.noise_px *= 2;
  noisy.simulation.robot_noise.translation_m *= 2;
  noisy.simulation.robot_noise.rotation_rad *= 2;
  const auto doubled = RigErrorBound(noisy);
  cell.arms.resize(15);
  const auto fewer = RigErrorBound(cell);
  ASSERT_TRUE(doubled && fewer);
  constexpr double kNumeric = 1e-6;
  for (size_t i = 0; i < bound->size(); ++i) {
    EXPECT_LT(((*doubled)[i] / 4 - (*bound)[i]).norm(), kNumeric * (*bound)[i].norm());
    EXPECT_GT((*fewer)[i].trace(), (*bound)[i].trace());
  }
}

TEST(RigStudyTest, SaysWhyThereIsNoBound) {
  RigStudyCell cell = CellOf(MixedRig(1));
  cell.arms.resize(1);
  EXPECT_FALSE(RigErrorBound(cell).ok());
  cell.arms.clear();
  EXPECT_EQ(RigErrorBound(cell).reason(), "no_target_in_view");
}

// 40 trials: the squared error of a pose in units of its bound is chi-square of 240 degrees of freedom if the estimate
// is efficient, whose 99.99 % range is 0.66 to 1.40 of its mean; the number of covered poses is at least 32 of 40 with
// a probability of 0.9999.
TEST(RigStudyTest, ReachesTheBoundAndGainsBetweenCameras) {
  RigSceneSetting setting;
  setting.has_free_intrinsics = false;
  const RigStudyCell cell = CellOf(FourCameraRig(1, setting), setting);
  constexpr int kNumTrials = 40;
  std::vector<std::vector<std::vector<TrialEstimate>>> trials;
  for (int trial = 0; trial < kNumTrials; ++trial) trials.push_back(RunRigTrial(cell, 1, trial));
  const auto bound = RigErrorBound(cell);
  ASSERT_TRUE(bound);
  const std::vector<RigPoseSummary> summaries = SummariseRig(cell, trials);
  ASSERT_THAT(summaries, SizeIs(10));
  for (size_t i = 0; i < summaries.size(); ++i) {
    const RigPoseSummary& summary = summaries[i];
    double squares = 0;
    for (const auto& trial : trials) {
      const Eigen::VectorXd& error = trial[i].at(0).error;
      squares += MahalanobisSquare(error, (*bound)[i]);
    }
    EXPECT_GT(squares / (6 * kNumTrials), 0.66) << summary.pose;
    EXPECT_LT(squares / (6 * kNumTrials), 1.40) << summary.pose;
    ASSERT_THAT(summary.methods, SizeIs(2));
    EXPECT_EQ(summary.methods[0].num_failed, 0);
    EXPECT_GE(*summary.methods[0].coverage, 32.0 / kNumTrials) << summary.pose;
    EXPECT_NEAR(summary.bound->hand_eye_m, std::sqrt((*bound)[i].topLeftCorner<3, 3>().trace()), 1e-12);
    EXPECT_FALSE(summary.bound->board_m.has_value());
    // All cameras share the errors of the arm, which cancel between them in the joint estimate only.
    if (summary.pose.find(" in camera ") == std::string::npos) continue;
    EXPECT_GT(summary.methods[1].rms.hand_eye_m, 2 * summary.methods[0].rms.hand_eye_m) << summary.pose;
  }
}

}  // namespace
}  // namespace heba
