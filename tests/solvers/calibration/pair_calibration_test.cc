#include "heba/pair_calibration.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "solvers/closed_form/hand_eye_method.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

TestScene SmallBoardScene(double noise_px) {
  TestSceneOptions options;
  options.num_captures = 14;
  options.points = GridPoints(2, 2, 0.05);
  options.noise_px = noise_px;
  return MakeTestScene(9, options);
}

PairCalibrationOptions OptionsOf(const TestScene& scene) {
  PairCalibrationOptions options;
  options.methods = HandEyeMethodNames();
  options.camera = scene.camera;
  options.width_px = scene.camera.width_px;
  options.height_px = scene.camera.height_px;
  options.bundle.free_intrinsics = {};
  return options;
}

void KeepPoints(int count, Observations* observations) {
  observations->ids.resize(static_cast<size_t>(count));
  observations->points_in_target = observations->points_in_target.leftCols(count).eval();
  observations->pixels = observations->pixels.leftCols(count).eval();
}

TEST(PairCalibrationTest, UsesViewsWithTooFewPointsForAPoseInTheRefinement) {
  TestScene scene = SmallBoardScene(0.05);
  KeepPoints(3, &scene.views[2].observations);
  KeepPoints(1, &scene.views[7].observations);
  const Outcome<PairCalibration> calibration = CalibratePair(scene.views, OptionsOf(scene));
  ASSERT_TRUE(calibration.ok()) << calibration.reason();
  ASSERT_TRUE(calibration->refined.ok()) << calibration->refined.reason();
  EXPECT_EQ(calibration->views.size(), scene.views.size());
  EXPECT_EQ(calibration->pairs.size(), scene.views.size() - 2);
  EXPECT_THAT(calibration->unused, testing::IsEmpty());
  // The views with few points add information: without them the variances are larger.
  std::vector<View> whole;
  for (const View& view : scene.views) {
    if (view.observations.size() == 4) whole.push_back(view);
  }
  const Outcome<PairCalibration> without = CalibratePair(whole, OptionsOf(scene));
  ASSERT_TRUE(without.ok() && without->refined.ok());
  const auto sum_of_variances = [](const PairCalibration& result) {
    return (result.refined->covariance.matrix.diagonal() /
            (result.refined->pixel_sigma_px * result.refined->pixel_sigma_px))
        .sum();
  };
  EXPECT_LT(sum_of_variances(*calibration), sum_of_variances(*without));
}

TEST(PairCalibrationTest, RejectsAViewOfFewPointsThatContradictsTheOthers) {
  TestScene scene = SmallBoardScene(0.05);
  KeepPoints(2, &scene.views[4].observations);
  scene.views[4].observations.pixels.array() += 40;
  const Outcome<PairCalibration> calibration = CalibratePair(scene.views, OptionsOf(scene));
  ASSERT_TRUE(calibration.ok() && calibration->refined.ok());
  EXPECT_EQ(calibration->views.size(), scene.views.size() - 1);
  ASSERT_EQ(calibration->unused.size(), 1U);
  EXPECT_EQ(calibration->unused[0].name, scene.views[4].name);
  EXPECT_THAT(calibration->unused[0].reason, testing::HasSubstr("not where the other captures predict them"));
}

// A later model judges the points again that the first one rejects.
TEST(PairCalibrationTest, TakesRejectedPointsBackUnderAnotherModel) {
  constexpr size_t kView = 2;
  constexpr Eigen::Index kNumWrong = 5;
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.05;
  const TestScene scene = MakeTestScene(4, scene_options);
  std::vector<View> views = scene.views;
  for (size_t i = 0; i < views.size(); ++i) views[i].capture = i;
  const Eigen::Index num_points = views[kView].observations.size();
  views[kView].observations.pixels.leftCols(kNumWrong).array() += 30;
  const PairCalibrationOptions options = OptionsOf(scene);
  Outcome<PairCalibration> first = CalibratePair(views, options);
  ASSERT_TRUE(first.ok() && first->refined.ok());
  const auto num_used = [&](const PairCalibration& calibration) {
    return std::find_if(calibration.views.begin(), calibration.views.end(),
                        [&](const View& view) { return view.capture == kView; })
        ->observations.size();
  };
  EXPECT_EQ(num_used(*first), num_points - kNumWrong);
  ASSERT_EQ(first->with_rejected.size(), 1U);
  // These points are right by another model.
  first->with_rejected[0].observations.pixels = scene.views[kView].observations.pixels;
  RobotErrors errors;
  errors.smooth = SmoothPoseErrors::kAlways;
  const RobotErrorsFound second = CalibrateRobotErrors(*first, options, errors);
  ASSERT_TRUE(second.smooth.has_value());
  EXPECT_EQ(num_used(second.calibration), num_points);
  EXPECT_TRUE(second.calibration.with_rejected.empty());
}

// Beside smooth errors the captures do not reject a target as designed, even if its scale is wrong.
TEST(PairCalibrationTest, ShapeOfTheTargetStaysBesideSmoothErrors) {
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.1;
  scene_options.robot_translation_m = 1e-3;
  scene_options.robot_rotation_rad = 1e-3;
  scene_options.shape[0] = scene_options.shape[1] = 0.99;
  for (int seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    TestScene scene = MakeTestScene(seed, scene_options);
    for (size_t i = 0; i < scene.views.size(); ++i) scene.views[i].capture = i;
    PairCalibrationOptions options = OptionsOf(scene);
    options.choose.robot_noise = true;
    options.choose.target_shape = true;
    const Outcome<PairCalibration> first = CalibratePair(scene.views, options);
    ASSERT_TRUE(first.ok() && first->refined.ok());
    ASSERT_FALSE(first->bundle.free_shape.empty());
    RobotErrors errors;
    errors.smooth = SmoothPoseErrors::kAlways;
    const RobotErrorsFound second = CalibrateRobotErrors(*first, options, errors);
    ASSERT_TRUE(second.smooth.has_value());
    EXPECT_EQ(second.calibration.bundle.free_shape, first->bundle.free_shape);
    // The model with smooth errors is compared with the chosen one of those without.
    const std::vector<ModelAlternative>& all = second.calibration.alternatives;
    ASSERT_EQ(all.size(), first->alternatives.size() + 1);
    const auto without = std::find_if(all.begin(), all.end(), [&](const ModelAlternative& one) {
      return one.model.robot == first->bundle.robot && one.model.shape == first->bundle.free_shape;
    });
    EXPECT_NEAR(all.back().log_likelihood - without->log_likelihood, second.smooth->log_likelihood_gain, 1e-9);
  }
}

}  // namespace
}  // namespace heba
