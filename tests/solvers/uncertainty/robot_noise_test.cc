#include "solvers/uncertainty/robot_noise.h"

#include <pthread.h>
#include <sys/mman.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/bundle_adjustment.h"
#include "heba/geometry/pose_block.h"
#include "solvers/residuals/repeated_poses.h"
#include "tests/support/linearised_views.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

constexpr double kTranslationM = 1e-4;
const double kRotationRad = DegToRad(0.02);
constexpr double kPixelPx = 0.1;

TestScene NoisyScene(uint64_t seed, Setup setup, double share = 1) {
  TestSceneOptions options;
  options.setup = setup;
  options.num_captures = 20;
  options.noise_px = kPixelPx;
  options.robot_translation_m = share * kTranslationM;
  options.robot_rotation_rad = share * kRotationRad;
  return MakeTestScene(seed, options);
}

double MedianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// Sums over the seeds: e' C^-1 e with 12 degrees of freedom per seed, and the squared position error of the hand-eye
// pose. The estimated sigmas are kept per seed.
struct Totals {
  double chi2 = 0;
  double squares_m2 = 0;
  std::vector<double> pixel_px;
  std::vector<double> translation_m;
  std::vector<double> rotation_rad;
};

Totals RunSeeds(Setup setup, double share, const BundleOptions& options, int num_seeds) {
  Totals totals;
  for (int seed = 1; seed <= num_seeds; ++seed) {
    const TestScene scene = NoisyScene(static_cast<uint64_t>(seed), setup, share);
    const Outcome<PairSolution> solution = RefineHandEye({scene.camera, scene.views, setup}, scene.hand_eye, options);
    EXPECT_TRUE(solution.ok()) << solution.reason();
    if (!solution) continue;
    Eigen::Matrix<double, 12, 1> error;
    error << LocalCoordinates(scene.hand_eye.camera_mount_from_camera, solution->hand_eye.camera_mount_from_camera),
        LocalCoordinates(scene.hand_eye.target_mount_from_target, solution->hand_eye.target_mount_from_target);
    totals.chi2 += MahalanobisSquare(error, solution->covariance.matrix.topLeftCorner<12, 12>());
    totals.squares_m2 += error.head<3>().squaredNorm();
    totals.pixel_px.push_back(solution->pixel_sigma_px);
    if (!solution->robot_noise) continue;
    totals.translation_m.push_back(solution->robot_noise->translation_m);
    totals.rotation_rad.push_back(solution->robot_noise->rotation_rad);
  }
  return totals;
}

BundleOptions OptionsOf(BundleOptions::Robot robot) {
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.free_intrinsics = {};
  options.robot = robot;
  options.robot_noise = {kTranslationM, kRotationRad};
  return options;
}

class RobotNoiseTest : public testing::TestWithParam<Setup> {};

TEST_P(RobotNoiseTest, CorrectionsApplyOnTheGripperSide) {
  const heba::Setup setup = GetParam();
  const TestScene scene = NoisyScene(3, setup);
  const Rigid3d& mount = scene.views[0].camera_mount_from_target_mount;
  const Tangent6 small = 1e-3 * Tangent6(1, -2, 3, 2, 1, -1);
  const Rigid3d correction = Retract(Rigid3d(), small);
  const Rigid3d corrected = CameraFromTarget(setup, scene.hand_eye, mount, correction);
  // The same pose is computed from the corrected pose of the robot.
  const Rigid3d base_from_gripper = BaseFromGripper(setup, mount) * correction;
  EXPECT_LT(
      DistanceM(corrected, CameraFromTarget(scene.hand_eye, CameraMountFromTargetMount(setup, base_from_gripper))),
      1e-12);
  const PairProblem problem{scene.camera, {scene.views.front()}, setup};
  const Problem whole = HandEyeProblem(problem, {});
  FitState state = StateAt(problem, scene.hand_eye);
  state.corrections = {{correction}};
  const LoopProblem loops = CaptureLoops(whole, {{0}}, state, {{1}, {0}, {{1, 1}}}, true);
  const LoopValues values = ValuesOf(state);
  LoopDerivatives derivatives;
  const Rigid3d by_loop =
      loops.captures[0].views[0].loop.Evaluate({values.poses, values.effects, {correction}}, &derivatives);
  EXPECT_LT(DistanceM(corrected, by_loop), 1e-12);
  EXPECT_LT(AngleRad(corrected, by_loop), 1e-12);
  const Matrix6 left = derivatives.own.front();
  for (int k = 0; k < 6; ++k) {
    constexpr double kStep = 1e-6;
    const Rigid3d moved =
        CameraFromTarget(setup, scene.hand_eye, mount, Retract(correction, kStep * Tangent6::Unit(k)));
    const Rigid3d difference = moved * Inverse(corrected);
    Tangent6 numeric;
    numeric << difference.translation, LogRotation(difference.rotation);
    EXPECT_LT((numeric / kStep - left.col(k)).norm(), 1e-4) << k;
  }
}

// The images are a million times more accurate than the robot: the corrections then absorb nearly all of their
// information, and the remainder must not be lost to rounding.
TEST_P(RobotNoiseTest, ExactImagesLeaveTheRobotUncertainty) {
  TestSceneOptions options;
  options.setup = GetParam();
  const TestScene scene = MakeTestScene(9, options);
  BundleOptions bundle = OptionsOf(BundleOptions::Robot::kGivenNoise);
  std::vector<double> sigmas_m;
  for (const double pixel_px : {1e-5, 1e-3}) {
    bundle.pixel_noise_px = pixel_px;
    const Outcome<PairSolution> solution =
        RefineHandEye({scene.camera, scene.views, GetParam()}, scene.hand_eye, bundle);
    ASSERT_TRUE(solution.ok()) << solution.reason();
    sigmas_m.push_back(std::sqrt(solution->covariance.matrix(0, 0)));
  }
  EXPECT_NEAR(sigmas_m[0], sigmas_m[1], 0.01 * sigmas_m[1]);
}

// If the noise is known, the errors agree with the covariance: the chi-square has 12 degrees of freedom per seed, and
// the tolerance is four sigma of the sum.
TEST_P(RobotNoiseTest, KnownNoiseGivesACorrectCovarianceAndABetterEstimate) {
  constexpr int kSeeds = 60;
  const Totals given = RunSeeds(GetParam(), 1, OptionsOf(BundleOptions::Robot::kGivenNoise), kSeeds);
  const double dof = 12.0 * kSeeds;
  EXPECT_NEAR(given.chi2, dof, 4 * std::sqrt(2 * dof));
  EXPECT_NEAR(MedianOf(given.pixel_px), kPixelPx, 0.03 * kPixelPx);
  // If the robot is assumed to be exact, the estimate is worse and its covariance does not show it.
  const Totals exact = RunSeeds(GetParam(), 1, OptionsOf(BundleOptions::Robot::kExact), kSeeds);
  EXPECT_GT(exact.squares_m2, 1.3 * given.squares_m2);
  EXPECT_GT(exact.chi2, 5 * dof);
}

TEST_P(RobotNoiseTest, EstimatesNoiseFromTheCaptures) {
  constexpr int kSeeds = 60;
  const Totals found = RunSeeds(GetParam(), 1, OptionsOf(BundleOptions::Robot::kEstimatedNoise), kSeeds);
  EXPECT_NEAR(MedianOf(found.pixel_px), kPixelPx, 0.03 * kPixelPx);
  EXPECT_NEAR(MedianOf(found.translation_m), kTranslationM, 0.15 * kTranslationM);
  EXPECT_NEAR(MedianOf(found.rotation_rad), kRotationRad, 0.15 * kRotationRad);
  const Totals given = RunSeeds(GetParam(), 1, OptionsOf(BundleOptions::Robot::kGivenNoise), kSeeds);
  EXPECT_LT(found.squares_m2, 1.2 * given.squares_m2);
  // Variances that are estimated from twenty captures are uncertain themselves: the squared errors exceed the stated
  // covariance by up to a third.
  EXPECT_LT(found.chi2, 12.0 * kSeeds * 1.4);
}

TEST_P(RobotNoiseTest, FindsAnExactRobotToBeExact) {
  constexpr int kSeeds = 40;
  for (const bool camera_is_free : {false, true}) {
    BundleOptions estimated = OptionsOf(BundleOptions::Robot::kEstimatedNoise);
    BundleOptions exact = OptionsOf(BundleOptions::Robot::kExact);
    if (camera_is_free) {
      estimated.free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint,
                                   ParameterGroup::kDistortion};
      exact.free_intrinsics = estimated.free_intrinsics;
    }
    const Totals found = RunSeeds(GetParam(), 0, estimated, kSeeds);
    const Totals known = RunSeeds(GetParam(), 0, exact, kSeeds);
    RecordProperty(camera_is_free ? "ratio_free" : "ratio_held",
                   std::to_string(std::sqrt(found.squares_m2 / known.squares_m2)));
    EXPECT_LT(std::sqrt(found.squares_m2), 1.3 * std::sqrt(known.squares_m2)) << camera_is_free;
    EXPECT_LT(MedianOf(found.translation_m), 0.2 * kTranslationM);
    EXPECT_LT(MedianOf(found.rotation_rad), 0.2 * kRotationRad);
  }
}

INSTANTIATE_TEST_SUITE_P(Setups, RobotNoiseTest, testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                         [](const auto& test) { return std::string(SetupName(test.param)); });

// A correction affects only the first six rows of views with many points, and all rows of views with few points.
TEST(LinearViewTest, WhitenedRowsReproduceTheInverseCovariance) {
  for (const int columns : {2, 8}) {
    TestSceneOptions options;
    options.points = GridPoints(columns, 2, 0.04);
    options.noise_px = kPixelPx;
    const TestScene scene = MakeTestScene(5, options);
    const std::vector<LinearisedView> views =
        LineariseViews({scene.camera, scene.views, options.setup}, scene.hand_eye, {}, kPixelPx);
    for (const LinearisedView& view : views) {
      EXPECT_EQ(view.num_rows_without_effects, columns == 8 ? view.offset.size() - 6 : 0);
      EXPECT_TRUE(view.by_effects.bottomRows(view.num_rows_without_effects).isZero(0));
      constexpr double kPixelVariance = 1.3;
      const double translation_m2 = kTranslationM * kTranslationM;
      const double rotation_rad2 = kRotationRad * kRotationRad;
      const Tangent6 variances = CorrectionVariances({kTranslationM, kRotationRad});
      const auto by_translation = view.by_effects.leftCols<3>();
      const auto by_rotation = view.by_effects.rightCols<3>();
      Eigen::MatrixXd covariance = translation_m2 * by_translation * by_translation.transpose() +
                                   rotation_rad2 * by_rotation * by_rotation.transpose();
      covariance.diagonal().array() += kPixelVariance;
      EXPECT_TRUE(MarginalCovariance(view, kPixelVariance, variances).isApprox(covariance, 1e-12));
      Eigen::MatrixXd rows(view.offset.size(), view.by_unknowns.cols() + 1);
      rows << view.by_unknowns, view.offset;
      const Eigen::MatrixXd expected = rows.transpose() * SolveSymmetric(covariance, rows);
      const RowMajorMatrix whitened = WhitenedRows(view, kPixelVariance, variances);
      const Eigen::VectorXd scale = expected.diagonal().cwiseSqrt().cwiseInverse();
      const Eigen::MatrixXd difference =
          scale.asDiagonal() * (whitened.transpose() * whitened - expected) * scale.asDiagonal();
      EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-9);
    }
  }
}

TEST(CorrectionPriorTest, JacobianIsTheDerivative) {
  constexpr RobotNoise kNoise = {1e-3, 2e-3};
  const Rigid3d correction = Retract(Rigid3d(), Tangent6(1e-3, 2e-3, -1e-3, 0.02, -0.03, 0.01));
  const NuisancePoseResidual prior = NuisancePoseResidualAt(correction, CorrectionPrior(kNoise));
  for (int k = 0; k < 6; ++k) {
    constexpr double kStep = 1e-6;
    const auto residual_at = [&](double step) {
      return NuisancePoseResidualAt(Retract(correction, step * Tangent6::Unit(k)), CorrectionPrior(kNoise)).residual;
    };
    const Tangent6 numeric = (residual_at(kStep) - residual_at(-kStep)) / (2 * kStep);
    EXPECT_LT((numeric - prior.by_tangent.col(k)).norm(), 1e-5 * numeric.norm()) << k;
  }
}

#ifdef MAP_32BIT  // Not available on every processor.

// Runs `work` in a thread whose stack lies below the heap; the stack of the main thread lies above it.
void RunOnLowStack(const std::function<void()>& work) {
  constexpr size_t kStackBytes = size_t{64} << 20;
  void* const stack =
      mmap(nullptr, kStackBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_32BIT, -1, 0);
  ASSERT_NE(stack, MAP_FAILED);
  pthread_attr_t attributes;
  ASSERT_EQ(pthread_attr_init(&attributes), 0);
  ASSERT_EQ(pthread_attr_setstack(&attributes, stack, kStackBytes), 0);
  pthread_t thread{};
  const auto run = [](void* argument) -> void* {
    (*static_cast<const std::function<void()>*>(argument))();
    return nullptr;
  };
  ASSERT_EQ(pthread_create(&thread, &attributes, run, const_cast<std::function<void()>*>(&work)), 0);  // NOLINT
  ASSERT_EQ(pthread_join(thread, nullptr), 0);
  pthread_attr_destroy(&attributes);
  munmap(stack, kStackBytes);
}

// Ceres orders unknowns by their addresses. The result must nevertheless have the same digits in every thread.
TEST(RefinementTest, IsBitIdenticalInEveryThread) {
  TestSceneOptions options;
  options.noise_px = 0.2;
  options.robot_translation_m = 5e-4;
  options.robot_rotation_rad = 1e-3;
  const TestScene scene = MakeTestScene(4, options);
  BundleOptions bundle;
  bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  const auto solve = [&] { return RefineHandEye({scene.camera, scene.views}, scene.hand_eye, bundle); };
  const Outcome<PairSolution> here = solve();
  ASSERT_TRUE(here.ok()) << here.reason();
  std::optional<Outcome<PairSolution>> there;
  RunOnLowStack([&] { there = solve(); });
  ASSERT_TRUE(there && there->ok());
  const PairSolution& other = **there;
  EXPECT_EQ(here->hand_eye.camera_mount_from_camera.translation, other.hand_eye.camera_mount_from_camera.translation);
  EXPECT_EQ(here->hand_eye.target_mount_from_target.translation, other.hand_eye.target_mount_from_target.translation);
  EXPECT_EQ(here->camera.params, other.camera.params);
  EXPECT_EQ(here->covariance.matrix, other.covariance.matrix);
}

#endif  // MAP_32BIT

// The prior of a correction whose noise includes that of joints is the inverse of its covariance.
TEST(CorrectionPriorTest, NoiseOfJointsIsPartOfTheCovariance) {
  RobotNoise noise{2e-4, 5e-4, 3e-4};
  const Matrix6X by_joints = Matrix6X::Random(6, 7);
  const Matrix6 prior = CorrectionPrior(noise, by_joints);
  Matrix6 covariance = CorrectionVariances(noise).asDiagonal();
  covariance += noise.joint_rad * noise.joint_rad * by_joints * by_joints.transpose();
  EXPECT_LT((prior * covariance * prior.transpose() - Matrix6::Identity()).cwiseAbs().maxCoeff(), 1e-9);
  const Eigen::VectorXd variances = CorrectionVariances(noise, 6 + 7);
  EXPECT_EQ(variances.size(), 13);
  EXPECT_EQ(variances[12], noise.joint_rad * noise.joint_rad);
}

// Captures at one pose share their error only if the arm is in one posture, as far as that is known.
TEST(RepeatedPosesTest, PosesInDifferentPosturesAreNotRepeats) {
  std::vector<View> views(4);
  for (View& view : views) view.camera_mount_from_target_mount.translation.x() = 0.5;
  EXPECT_EQ(GroupByRobotPose(Setup::kEyeToHand, views).size(), 1U);
  views[0].joints = views[1].joints = {0.1, 0.2, 0.3};
  views[2].joints = {0.1, 0.2, 1.3};
  views[3].joints = {0.1, 0.2, 1.3 + 1e-5};
  const PoseGroups groups = GroupByRobotPose(Setup::kEyeToHand, views);
  ASSERT_EQ(groups.size(), 2U);
  EXPECT_EQ(groups[0], (std::vector<size_t>{0, 1}));
  EXPECT_EQ(groups[1], (std::vector<size_t>{2, 3}));
}

}  // namespace
}  // namespace heba
