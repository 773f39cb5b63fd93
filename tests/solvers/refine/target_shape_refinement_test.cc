// Tests of the target's shape as an unknown: it is estimated as accurately as the pixel noise allows, and refused if
// the captures do not determine it.
#include <array>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/bundle_adjustment.h"
#include "heba/pair_calibration.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/robot_noise.h"
#include "tests/support/linearised_views.h"
#include "tests/support/matchers.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

constexpr double kNoisePx = 0.1;
constexpr std::array<double, TargetShape::kNumParams> kMade = {1.001, 1.0005, 5e-4, -3e-4, 4e-4};

PairProblem ProblemOf(const TestScene& scene, const TestSceneOptions& options) {
  return {scene.camera, scene.views, options.setup, DesignedShape(options.points)};
}

TEST(TargetShapeRefinementTest, ShapeAndHandEyeReachTheBound) {
  TestSceneOptions scene_options;
  scene_options.noise_px = kNoisePx;
  scene_options.shape = kMade;
  TargetShape made = DesignedShape(scene_options.points);
  made.params = kMade;
  BundleOptions options;
  options.free_shape = {TargetShapeGroup::kScale, TargetShapeGroup::kBend, TargetShapeGroup::kTwist};
  constexpr int kNumSeeds = 60;
  double error_m2 = 0;
  double designed_error_m2 = 0;
  double bound_m2 = 0;
  constexpr Eigen::Index kNumShape = 5;
  Eigen::Vector<double, kNumShape> shape_squares = Eigen::Vector<double, kNumShape>::Zero();
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    const TestScene scene = MakeTestScene(seed, scene_options);
    const PairProblem problem = ProblemOf(scene, scene_options);
    const Outcome<PairSolution> solution = RefineHandEye(problem, scene.hand_eye, options);
    ASSERT_TRUE(solution.ok()) << solution.reason();
    const Outcome<PairSolution> as_designed = RefineHandEye(problem, scene.hand_eye, BundleOptions());
    ASSERT_TRUE(as_designed.ok()) << as_designed.reason();
    const Rigid3d& truth = scene.hand_eye.camera_mount_from_camera;
    error_m2 += std::pow(DistanceM(solution->hand_eye.camera_mount_from_camera, truth), 2);
    designed_error_m2 += std::pow(DistanceM(as_designed->hand_eye.camera_mount_from_camera, truth), 2);
    EXPECT_EQ(solution->covariance.layout.Names().back(), "target.twist_m");
    for (Eigen::Index i = 0; i < kNumShape; ++i) {
      const size_t k = static_cast<size_t>(i);
      const Eigen::Index row = solution->covariance.matrix.rows() - kNumShape + i;
      shape_squares[i] += std::pow(solution->shape.params[k] - kMade[k], 2) / solution->covariance.matrix(row, row);
    }
    const std::vector<LinearisedView> linear =
        LineariseViews({scene.camera, scene.views, scene_options.setup, made}, scene.hand_eye, options, kNoisePx);
    const Information information{solution->covariance.layout,
                                  MarginalInformation(linear, CorrectionVariances({}), 1.0)};
    bound_m2 += InvertInformation(information, 1.0).matrix.topLeftCorner<3, 3>().trace();
  }
  // The RMS of 60 trials of three coordinates scatters by about 7 %.
  EXPECT_LT(std::sqrt(error_m2 / bound_m2), 1.2);
  EXPECT_GT(std::sqrt(designed_error_m2 / bound_m2), 1.5);
  for (const double square : shape_squares) EXPECT_NEAR(std::sqrt(square / kNumSeeds), 1, 0.3);
}

// The target is badly made and deviates from its design by many pixels: captures are judged by the estimated shape.
TEST(TargetShapeRefinementTest, JudgesCapturesByTheEstimatedShape) {
  TestSceneOptions scene_options;
  scene_options.noise_px = kNoisePx;
  scene_options.shape = {1.02, 1.02, 3e-3, 0};
  const TestScene scene = MakeTestScene(6, scene_options);
  PairCalibrationOptions options;
  options.camera = scene.camera;
  options.bundle.free_shape = {TargetShapeGroup::kScale, TargetShapeGroup::kBend};
  options.bundle.free_intrinsics = {};
  options.shape = DesignedShape(scene_options.points);
  const Outcome<PairCalibration> calibration = CalibratePair(scene.views, options);
  ASSERT_TRUE(calibration.ok()) << calibration.reason();
  ASSERT_TRUE(calibration->refined.ok()) << calibration->refined.reason();
  EXPECT_THAT(calibration->unused, testing::IsEmpty());
  EXPECT_NEAR(calibration->refined->shape.params[0], 1.02, 1e-4);
  EXPECT_NEAR(calibration->refined->pixel_sigma_px, kNoisePx, 0.01);
  EXPECT_LT(DistanceM(calibration->refined->hand_eye.camera_mount_from_camera, scene.hand_eye.camera_mount_from_camera),
            3e-4);
}

TEST(TargetShapeRefinementTest, RefusesBendForFourPoints) {
  TestSceneOptions scene_options;
  scene_options.points = GridPoints(2, 2, 0.1);
  const TestScene scene = MakeTestScene(7, scene_options);
  BundleOptions options;
  options.free_intrinsics = {};
  options.free_shape = {TargetShapeGroup::kBend};
  const Outcome<PairSolution> solution = RefineHandEye(ProblemOf(scene, scene_options), scene.hand_eye, options);
  ASSERT_FALSE(solution);
  EXPECT_THAT(solution.reason(), testing::HasSubstr("unknown target.bend_x_m"));
}

TEST(TargetShapeRefinementTest, RefusesScaleForRotationsAboutTheToolPoint) {
  TestSceneOptions scene_options;
  scene_options.motion = TestSceneOptions::Motion::kTwoStep;
  TestScene scene = MakeTestScene(8, scene_options);
  scene.views.erase(scene.views.begin() + 1, scene.views.begin() + 3);  // The translations are removed.
  BundleOptions options;
  options.free_intrinsics = {};
  options.free_shape = {TargetShapeGroup::kScale};
  const Outcome<PairSolution> solution = RefineHandEye(ProblemOf(scene, scene_options), scene.hand_eye, options);
  ASSERT_FALSE(solution);
  EXPECT_THAT(solution.reason(), testing::HasSubstr("unknown target.scale_"));
}

// A prior of the scales adds its information, with and without robot noise; a certain one holds them.
TEST(TargetScalePriorTest, AddsItsInformation) {
  for (const auto robot : {BundleOptions::Robot::kExact, BundleOptions::Robot::kEstimatedNoise}) {
    TestSceneOptions scene_options;
    scene_options.noise_px = 0.1;
    scene_options.shape = {1.002, 0.999, 0, 0};
    scene_options.robot_translation_m = robot == BundleOptions::Robot::kExact ? 0 : 2e-4;
    const TestScene scene = MakeTestScene(5, scene_options);
    BundleOptions options;
    options.loss = LossKind::kNone;
    options.robot = robot;
    options.free_shape = {TargetShapeGroup::kScale};
    options.pixel_noise_px = 0.1;
    const auto solve = [&](std::optional<double> sigma) {
      BundleOptions with = options;
      with.target_scale_sigma = sigma;
      return RefineHandEye({scene.camera, scene.views}, scene.hand_eye, with);
    };
    const Outcome<PairSolution> free = solve(std::nullopt);
    ASSERT_TRUE(free.ok()) << free.reason();
    const double sigma = *SigmaOf(free->covariance, "target.scale_x");
    const Outcome<PairSolution> held = solve(1e-9);
    ASSERT_TRUE(held.ok()) << held.reason();
    EXPECT_NEAR(held->shape.params[0], 1, 1e-7);
    EXPECT_NEAR(held->shape.params[1], 1, 1e-7);
    const Outcome<PairSolution> known = solve(sigma);
    ASSERT_TRUE(known.ok()) << known.reason();
    EXPECT_LT(*SigmaOf(known->covariance, "target.scale_x"), 0.8 * sigma);
    const auto off = [](const PairSolution& solution) {
      return std::hypot(solution.shape.params[0] - 1, solution.shape.params[1] - 1);
    };
    EXPECT_LT(off(*known), off(*free));
  }
}

}  // namespace
}  // namespace heba
