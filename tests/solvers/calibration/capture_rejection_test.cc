#include "solvers/calibration/capture_rejection.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/pair_calibration.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

std::set<std::string> LeftOutOf(const TestScene& scene, const TestSceneOptions& options) {
  PairCalibrationOptions calibration_options;
  calibration_options.setup = options.setup;
  calibration_options.camera = scene.camera;
  calibration_options.shape = DesignedShape(options.points);
  const Outcome<PairCalibration> calibration = CalibratePair(scene.views, calibration_options);
  EXPECT_TRUE(calibration.ok() && calibration->refined.ok());
  std::set<std::string> names;
  for (const UnusedView& unused : calibration->unused) names.insert(unused.name);
  return names;
}

// A target that is bent by 2 mm contradicts the flat model in every capture; no single capture is wrong.
TEST(WrongCapturesTest, RejectsAlmostNoCaptureForABentTarget) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    TestSceneOptions options;
    options.noise_px = 0.05;
    options.num_captures = 34;
    options.shape = {1, 1, 2e-3, 1e-3};
    const TestScene scene = MakeTestScene(seed, options);
    EXPECT_THAT(LeftOutOf(scene, options), testing::SizeIs(testing::Le(1U))) << seed;
  }
}

// If the robot's errors have long tails, the half of the captures that agrees best underestimates the noise, because
// it was selected for agreement. The other captures are not wrong. On the average of sets, a quarter is left out at
// most.
TEST(WrongCapturesTest, RejectsFewCapturesForLongTailedRobotNoise) {
  size_t num_left_out = 0;
  size_t num_captures = 0;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    TestSceneOptions options;
    options.noise_px = 0.05;
    options.num_captures = 40;
    TestScene scene = MakeTestScene(seed, options);
    Rng rng(seed + 100);
    for (View& view : scene.views) {
      // The errors are a scale mixture with sigmas from 0.1 to 1 mm.
      const double sigma = 1e-4 * std::pow(10.0, rng.Uniform());
      Tangent6 error;
      error << sigma * rng.NormalVector3(), 3 * sigma * rng.NormalVector3();
      view.camera_mount_from_target_mount = view.camera_mount_from_target_mount * Retract(Rigid3d(), error);
    }
    const size_t num_of_set = LeftOutOf(scene, options).size();
    EXPECT_LT(num_of_set, scene.views.size() / 2) << seed;
    num_left_out += num_of_set;
    num_captures += scene.views.size();
  }
  EXPECT_LE(num_left_out, num_captures / 4);
}

// A third of the poses are off by 10 mm. These are wrong poses and not noise: an accurate robot with wrong poses is
// more likely than a robot with so much noise.
TEST(WrongCapturesTest, FindsWrongPosesInAThirdOfTheCaptures) {
  TestSceneOptions options;
  options.noise_px = 0.05;
  options.num_captures = 45;
  options.robot_translation_m = 1e-4;
  options.robot_rotation_rad = 1e-4;
  TestScene scene = MakeTestScene(3, options);
  Rng rng(9);
  std::set<std::string> wrong;
  for (size_t i = 0; i < scene.views.size(); i += 3) {
    View& view = scene.views[i];
    wrong.insert(view.name);
    const Rigid3d shift(Eigen::Quaterniond::Identity(), 0.01 * rng.Direction3());
    view.camera_mount_from_target_mount = view.camera_mount_from_target_mount * shift;
  }
  EXPECT_EQ(LeftOutOf(scene, options), wrong);
}

// A capture whose points are all outliers is not used, even if it has a pose.
TEST(WrongCapturesTest, RejectsACaptureWithoutInliers) {
  TestSceneOptions options;
  options.noise_px = 0.05;
  options.num_captures = 20;
  TestScene scene = MakeTestScene(6, options);
  // The points belong to another image: each is moved by a different amount.
  Rng rng(2);
  Points2& pixels = scene.views[4].observations.pixels;
  for (Eigen::Index i = 0; i < pixels.size(); ++i) pixels.data()[i] += rng.Uniform(-60, 60);
  EXPECT_THAT(LeftOutOf(scene, options), testing::ElementsAre("view_4"));
}

}  // namespace
}  // namespace heba
