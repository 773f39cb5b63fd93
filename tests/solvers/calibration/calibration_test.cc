#include "heba/calibration.h"

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

CalibrationOptions OptionsOf(const TestScene& scene) {
  CalibrationOptions options;
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

TEST(CalibrationTest, UsesViewsWithTooFewPointsForAPoseInTheRefinement) {
  TestScene scene = SmallBoardScene(0.05);
  KeepPoints(3, &scene.views[2].observations);
  KeepPoints(1, &scene.views[7].observations);
  const Outcome<Calibration> calibration = Calibrate(scene.views, OptionsOf(scene));
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
  const Outcome<Calibration> without = Calibrate(whole, OptionsOf(scene));
  ASSERT_TRUE(without.ok() && without->refined.ok());
  const auto sum_of_variances = [](const Calibration& result) {
    return (result.refined->covariance.matrix.diagonal() /
            (result.refined->pixel_sigma_px * result.refined->pixel_sigma_px))
        .sum();
  };
  EXPECT_LT(sum_of_variances(*calibration), sum_of_variances(*without));
}

TEST(CalibrationTest, RejectsAViewOfFewPointsThatContradictsTheOthers) {
  TestScene scene = SmallBoardScene(0.05);
  KeepPoints(2, &scene.views[4].observations);
  scene.views[4].observations.pixels.array() += 40;
  const Outcome<Calibration> calibration = Calibrate(scene.views, OptionsOf(scene));
  ASSERT_TRUE(calibration.ok() && calibration->refined.ok());
  EXPECT_EQ(calibration->views.size(), scene.views.size() - 1);
  ASSERT_EQ(calibration->unused.size(), 1U);
  EXPECT_EQ(calibration->unused[0].name, scene.views[4].name);
  EXPECT_THAT(calibration->unused[0].reason, testing::HasSubstr("not where the other captures predict them"));
}

}  // namespace
}  // namespace heba
