#include "heba/camera_calibration.h"

#include <cmath>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

CameraCalibrationOptions OptionsFor(const TestScene& scene, const TestSceneOptions& scene_options) {
  CameraCalibrationOptions options;
  options.width_px = scene.camera.width_px;
  options.height_px = scene.camera.height_px;
  options.shape = DesignedShape(scene_options.points);
  options.folds = 0;
  return options;
}

Eigen::VectorXd Params(const Camera& camera) {
  return Eigen::Map<const Eigen::VectorXd>(camera.params.data(), static_cast<Eigen::Index>(camera.params.size()));
}

// The robot poses of the views are not used: here they are all the identity.
TEST(CameraCalibrationTest, SigmasAreThoseOfTheErrors) {
  constexpr int kNumTrials = 30;
  double squares = 0;
  double projection_squares = 0;
  double num_places = 0;
  double num_params = 0;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    TestSceneOptions scene_options;
    scene_options.noise_px = 0.2;
    TestScene scene = MakeTestScene(static_cast<uint64_t>(trial), scene_options);
    for (View& view : scene.views) view.camera_mount_from_target_mount = Rigid3d();
    CameraCalibrationOptions options = OptionsFor(scene, scene_options);
    options.model = "brown5";
    const Outcome<CameraCalibration> calibration = CalibrateCamera(scene.views, options);
    ASSERT_TRUE(calibration.ok()) << calibration.reason();
    const Eigen::VectorXd error = Params(calibration->camera) - Params(scene.camera);
    squares += MahalanobisSquare(error, calibration->covariance);
    num_params += static_cast<double>(error.size());

    // The projection differs from the true one by as much as its sigma says, once the best rotation is taken out.
    constexpr int kColumns = 6;
    constexpr int kRows = 5;
    const std::vector<double> sigmas_px = ProjectionSigmasPx(*calibration, kColumns, kRows);
    std::vector<Eigen::Vector3d> rays;
    std::vector<Eigen::Vector3d> true_rays;
    Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();  // The normal matrix of the best rotation.
    for (int i = 0; i < kColumns * kRows; ++i) {
      const Eigen::Vector2d pixel((i % kColumns + 0.5) * scene.camera.width_px / kColumns - 0.5,
                                  (i / kColumns + 0.5) * scene.camera.height_px / kRows - 0.5);
      const std::optional<Eigen::Vector3d> ray = UnprojectPixel(calibration->camera, pixel);
      const std::optional<Eigen::Vector3d> true_ray = UnprojectPixel(scene.camera, pixel);
      ASSERT_TRUE(ray && true_ray);
      rays.push_back(ray->normalized());
      true_rays.push_back(true_ray->normalized());
      cross += Eigen::Matrix3d::Identity() - true_rays.back() * true_rays.back().transpose();
    }
    Eigen::Vector3d moment = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < rays.size(); ++i) moment += true_rays[i].cross(rays[i]);
    const Eigen::Vector3d turn = SolveSymmetric(cross, moment);
    for (size_t i = 0; i < rays.size(); ++i) {
      const std::optional<Eigen::Vector2d> seen =
          ProjectPoint(calibration->camera, true_rays[i] + turn.cross(true_rays[i]));
      const std::optional<Eigen::Vector2d> expected = ProjectPoint(scene.camera, true_rays[i]);
      ASSERT_TRUE(seen && expected);
      projection_squares += 0.5 * (*seen - *expected).squaredNorm() / (sigmas_px[i] * sigmas_px[i]);
      num_places += 1;
    }
  }
  EXPECT_GT(squares / num_params, 0.7);
  EXPECT_LT(squares / num_params, 1.35);
  EXPECT_GT(projection_squares / num_places, 0.4);
  EXPECT_LT(projection_squares / num_places, 2.0);
}

TEST(CameraCalibrationTest, TellsTheLensFromABentTarget) {
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.05;
  scene_options.shape = {1, 1, 1.5e-3, -0.7e-3};
  scene_options.num_captures = 20;
  const TestScene scene = MakeTestScene(3, scene_options);
  const Outcome<CameraCalibration> calibration = CalibrateCamera(scene.views, OptionsFor(scene, scene_options));
  ASSERT_TRUE(calibration.ok()) << calibration.reason();
  EXPECT_TRUE(calibration->lenses[calibration->chosen].is_bent);
  EXPECT_NEAR(calibration->shape.params[2], 1.5e-3, 1e-4);
  EXPECT_NEAR(calibration->shape.params[3], -0.7e-3, 1e-4);
  constexpr double kSigmas = 5;
  EXPECT_NEAR(calibration->camera.params[0], scene.camera.params[0],
              kSigmas * std::sqrt(calibration->covariance(0, 0)));
  CameraCalibrationOptions flat = OptionsFor(scene, scene_options);
  flat.choose_bend = false;
  const Outcome<CameraCalibration> of_flat = CalibrateCamera(scene.views, flat);
  ASSERT_TRUE(of_flat.ok());
  EXPECT_GT(of_flat->pixel_sigma_px, 1.2 * calibration->pixel_sigma_px);
}

TEST(CameraCalibrationTest, ComparesAllModels) {
  TestSceneOptions scene_options;
  scene_options.noise_px = 0.1;
  scene_options.camera = TestCamera("kannala_brandt4");
  const TestScene scene = MakeTestScene(4, scene_options);
  CameraCalibrationOptions options = OptionsFor(scene, scene_options);
  options.folds = 5;
  const Outcome<CameraCalibration> calibration = CalibrateCamera(scene.views, options);
  ASSERT_TRUE(calibration.ok()) << calibration.reason();
  EXPECT_EQ(calibration->lenses.size(), 8U);
  for (const LensFit& lens : calibration->lenses) {
    if (lens.model != "kannala_brandt4") continue;
    ASSERT_TRUE(lens.camera.has_value());
    EXPECT_NEAR(lens.rms_px, 0.1 * std::sqrt(2.0), 0.03);
    ASSERT_TRUE(lens.holdout_rms_px.has_value());
    EXPECT_NEAR(*lens.holdout_rms_px, 0.1 * std::sqrt(2.0), 0.03);
  }
}

TEST(CameraCalibrationTest, FailsWithTooFewViews) {
  TestScene scene = MakeTestScene(5);
  scene.views.resize(2);
  const Outcome<CameraCalibration> calibration = CalibrateCamera(scene.views, OptionsFor(scene, {}));
  EXPECT_FALSE(calibration.ok());
  EXPECT_FALSE(calibration.reason().empty());
}

}  // namespace
}  // namespace heba
