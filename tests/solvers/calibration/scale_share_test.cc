#include "solvers/calibration/scale_share.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/bundle_adjustment.h"
#include "heba/data/hand_eye.h"
#include "heba/geometry/rigid3.h"
#include "heba/kernels/small_matrix.h"
#include "heba/pair_calibration.h"
#include "solvers/calibration/calibration_problem.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/residuals/inliers.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

constexpr double kNoisePx = 0.1;

TestSceneOptions NoisyScene(Setup setup) {
  TestSceneOptions options;
  options.setup = setup;
  options.noise_px = kNoisePx;
  return options;
}

// Returns the views as a robot reports them whose translations are too short by a ratio.
std::vector<View> ReportedShort(std::vector<View> views, double ratio) {
  for (View& view : views) view.camera_mount_from_target_mount.translation /= 1 + ratio;
  return views;
}

Tangent6 ChangeOf(const HandEye& from, const HandEye& to) {
  return LocalCoordinates(from.camera_mount_from_camera, to.camera_mount_from_camera);
}

// Returns the sum of the squares of the changes in the covariance of the hand-eye pose.
Matrix6 HandEyePart(const ScaleShare& share) {
  Matrix6 sum = Matrix6::Zero();
  for (const Eigen::VectorXd& change : share.changes) sum += change.head<6>() * change.head<6>().transpose();
  return sum;
}

// The prediction for a robot of another scale is what an adjustment of its poses finds.
TEST(ScaleShareTest, IsTheChangeByARobotOfAnotherScale) {
  constexpr double kSigma = 1e-3;
  for (const heba::Setup setup : {heba::Setup::kEyeToHand, heba::Setup::kEyeInHand}) {
    const TestSceneOptions scene_options = NoisyScene(setup);
    const TestScene scene = MakeTestScene(3, scene_options);
    BundleOptions options;
    options.loss = LossKind::kNone;
    options.pixel_noise_px = kNoisePx;
    options.free_shape = {TargetShapeGroup::kScale};
    const PairProblem problem{scene.camera, scene.views, setup, DesignedShape(scene_options.points)};
    const Outcome<PairSolution> solution = RefineHandEye(problem, scene.hand_eye, options);
    ASSERT_TRUE(solution.ok()) << solution.reason();
    PairProblem stretched = problem;
    stretched.views = ReportedShort(problem.views, kSigma);
    const Outcome<PairSolution> other = RefineHandEye(stretched, scene.hand_eye, options);
    ASSERT_TRUE(other.ok()) << other.reason();
    const Tangent6 change = ChangeOf(solution->hand_eye, other->hand_eye);
    const ScaleShare share =
        ShareOfScales(HandEyeProblem(problem, options), ProblemSolution(*solution), {{kTargetScaleSigma}, {kSigma}});
    const Matrix6 expected = change * change.transpose();
    EXPECT_LT((HandEyePart(share) - expected).norm(), 0.01 * expected.norm());
    // All lengths of the result follow the robot, so that no rotation changes.
    EXPECT_LT(change.tail<3>().norm(), 1e-6);
    EXPECT_LT((share.repeatable.matrix - solution->covariance.matrix).norm(), 1e-12);
    ASSERT_EQ(share.findings.size(), 1U);
    EXPECT_EQ(share.findings[0].code, "scale_source");
    EXPECT_EQ(share.findings[0].Name("source"), "robot");
    EXPECT_NEAR(*share.findings[0].Number("share_mm"), 1000 * change.head<3>().norm(),
                0.01 * 1000 * change.head<3>().norm());
  }
}

// A held scale about which there is prior knowledge leaves what an adjustment that frees it with this knowledge states.
TEST(ScaleShareTest, IsThatOfAFreeScaleWithPriorKnowledge) {
  constexpr double kSigma = 1e-3;
  const TestSceneOptions scene_options = NoisyScene(Setup::kEyeToHand);
  const TestScene scene = MakeTestScene(4, scene_options);
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.pixel_noise_px = kNoisePx;
  options.robot = BundleOptions::Robot::kGivenNoise;
  options.robot_noise = {1e-3, 1e-3, 0};
  const PairProblem problem{scene.camera, scene.views, Setup::kEyeToHand, DesignedShape(scene_options.points)};
  const Outcome<PairSolution> held = RefineHandEye(problem, scene.hand_eye, options);
  ASSERT_TRUE(held.ok()) << held.reason();
  BundleOptions freed_options = options;
  freed_options.free_shape = {TargetShapeGroup::kScale};
  freed_options.target_scale_sigma = kSigma;
  const Outcome<PairSolution> freed = RefineHandEye(problem, scene.hand_eye, freed_options);
  ASSERT_TRUE(freed.ok()) << freed.reason();
  const ScaleShare share = ShareOfScales(HandEyeProblem(problem, options), ProblemSolution(*held), {{kSigma}, {0.0}});
  const Tangent6 moved = ChangeOf(held->hand_eye, freed->hand_eye);
  const Matrix6 expected = freed->covariance.matrix.topLeftCorner<6, 6>() + moved * moved.transpose();
  const Matrix6 total = held->covariance.matrix.topLeftCorner<6, 6>() + HandEyePart(share);
  EXPECT_LT((total - expected).norm(), 0.02 * expected.norm());
  EXPECT_GT(HandEyePart(share).norm(), 0.05 * expected.norm()) << "the scale is to matter here";
}

// The prior knowledge of a scale that was free is common to all sessions.
TEST(ScaleShareTest, RepeatableCovarianceHasNoPriorKnowledge) {
  constexpr double kSigma = 1e-6;
  const TestScene scene = MakeTestScene(5, NoisyScene(Setup::kEyeToHand));
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.pixel_noise_px = kNoisePx;
  const PairProblem problem{scene.camera, scene.views, Setup::kEyeToHand, DesignedShape(TestSceneOptions().points)};
  const Outcome<PairSolution> held = RefineHandEye(problem, scene.hand_eye, options);
  options.free_shape = {TargetShapeGroup::kScale};
  options.target_scale_sigma = kSigma;
  const Outcome<PairSolution> freed = RefineHandEye(problem, scene.hand_eye, options);
  ASSERT_TRUE(held.ok() && freed.ok());
  const ScaleShare share = ShareOfScales(HandEyeProblem(problem, options), ProblemSolution(*freed), {{kSigma}, {0.0}});
  // A scale that is known exactly, and the noise that is left if it is held.
  const Matrix6 expected = held->covariance.matrix.topLeftCorner<6, 6>();
  EXPECT_LT((share.repeatable.matrix.topLeftCorner<6, 6>() - expected).norm(), 0.01 * expected.norm());
  EXPECT_TRUE(share.changes.empty());
}

TEST(ScaleShareTest, NothingIsAddedToExactLengths) {
  const TestScene scene = MakeTestScene(6, NoisyScene(Setup::kEyeToHand));
  BundleOptions options;
  const PairProblem problem{scene.camera, scene.views, Setup::kEyeToHand, DesignedShape(TestSceneOptions().points)};
  const Outcome<PairSolution> solution = RefineHandEye(problem, scene.hand_eye, options);
  ASSERT_TRUE(solution.ok());
  const ScaleShare share = ShareOfScales(HandEyeProblem(problem, options), ProblemSolution(*solution), {{0.0}, {0.0}});
  EXPECT_TRUE(share.changes.empty());
  EXPECT_TRUE(share.findings.empty());
}

// Draws both scales from what is known about them: 95 % regions of the total covariance hold the truth, and those of
// the estimate alone do so in some 60 %.
TEST(ScaleShareTest, RegionsHoldOverScalesDrawnFromTheirPriors) {
  constexpr double kOfTarget = 4e-3;
  constexpr double kOfRobot = 1e-3;
  constexpr int kNumTrials = 100;
  int num_covered = 0;
  int num_covered_without = 0;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    std::mt19937_64 random(1000 + static_cast<uint64_t>(trial));
    std::normal_distribution<double> normal;
    TestSceneOptions scene_options = NoisyScene(trial % 2 == 0 ? Setup::kEyeToHand : Setup::kEyeInHand);
    scene_options.num_captures = 12;
    scene_options.points = GridPoints(5, 4, 0.04);
    scene_options.robot_translation_m = 1e-4;
    scene_options.robot_rotation_rad = 2e-4;
    scene_options.shape = {1 + kOfTarget * normal(random), 1 + kOfTarget * normal(random), 0, 0};
    const TestScene scene = MakeTestScene(static_cast<uint64_t>(trial), scene_options);
    PairCalibrationOptions options;
    options.setup = scene_options.setup;
    options.camera = scene.camera;
    options.bundle.free_intrinsics = {};
    options.choose.robot_noise = true;
    options.choose.target_shape = true;
    options.width_px = scene.camera.width_px;
    options.height_px = scene.camera.height_px;
    options.shape = DesignedShape(scene_options.points);
    const Outcome<PairCalibration> calibration =
        CalibratePair(ReportedShort(scene.views, kOfRobot * normal(random)), options);
    ASSERT_TRUE(calibration && calibration->refined) << calibration.reason();
    const SearchedModel all = AsProblem(*calibration, options).model;
    const Solution& solution = all.judged.solution;
    const ScaleShare share = ShareOfScales(WithoutRejected(Without(all.problem, all.judged.left_out), solution),
                                           solution, {{kOfTarget}, {kOfRobot}});
    const PairSolution total = WithShare(*calibration->refined, share, {}, {});
    const auto is_covered = [&](const Covariance& covariance) {
      const Tangent6 error = ChangeOf(total.hand_eye, scene.hand_eye);
      const Matrix6 of_pose = covariance.matrix.topLeftCorner<6, 6>();
      constexpr double kLevel = 0.05;
      return FisherTail(MahalanobisSquare(error, of_pose) / 6, 6, total.covariance_dof) > kLevel;
    };
    num_covered += is_covered(total.covariance) ? 1 : 0;
    num_covered_without += is_covered(calibration->refined->covariance) ? 1 : 0;
  }
  EXPECT_GE(num_covered, 89);
  EXPECT_LE(num_covered, 100);
  EXPECT_LT(num_covered_without, 60);
}

}  // namespace
}  // namespace heba
