// A single camera is a rig with one camera: both calibrations give the same result.
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "heba/calibration.h"
#include "heba/pair_calibration.h"
#include "solvers/refine/hand_eye_problem.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

struct Kind {
  std::string name;
  Setup setup;
  double robot_m;
  double robot_rad;
  std::array<double, TargetShape::kNumParams> shape;
};
void PrintTo(const Kind& kind, std::ostream* stream) { *stream << kind.name; }

constexpr std::array<double, TargetShape::kNumParams> kDesigned = {1, 1, 0, 0};

class SingleCameraTest : public testing::TestWithParam<Kind> {
 protected:
  SingleCameraTest() {
    scene_options_.noise_px = 0.1;
    scene_options_.num_captures = 20;
    scene_options_.setup = GetParam().setup;
    scene_options_.robot_translation_m = GetParam().robot_m;
    scene_options_.robot_rotation_rad = GetParam().robot_rad;
    scene_options_.shape = GetParam().shape;
    scene_ = MakeTestScene(11, scene_options_);
    for (size_t i = 0; i < scene_.views.size(); ++i) {
      scene_.views[i].name = std::to_string(i);
      scene_.views[i].capture = i;
    }
    // A rig's arms are noisy, and its cameras are given.
    options_.setup = scene_options_.setup;
    options_.camera = scene_.camera;
    options_.shape = DesignedShape(scene_options_.points);
    options_.choose.robot_noise = false;
    options_.bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  }

  Problem AsNamedCell() const {
    Problem rig = HandEyeProblem({scene_.camera, scene_.views, options_.setup, options_.shape}, options_.bundle);
    rig.robots[0] = "arm";
    rig.cameras[0].name = "camera";
    rig.targets[0].name = "board";
    return rig;
  }

  TestSceneOptions scene_options_;
  TestScene scene_;
  PairCalibrationOptions options_;
};

TEST_P(SingleCameraTest, EqualsAProblemWithOneCamera) {
  const Outcome<PairCalibration> single = CalibratePair(scene_.views, options_);
  ASSERT_TRUE(single.ok() && single->refined.ok());
  CalibrationOptions rig_options;
  rig_options.has_camera = {true};
  rig_options.smooth = SmoothPoseErrors::kNone;
  const Outcome<Calibration> rig = Calibrate(AsNamedCell(), rig_options);
  ASSERT_TRUE(rig.ok() && rig->refined.ok());
  EXPECT_EQ(rig->problem.targets[0].free_shape, single->bundle.free_shape);
  EXPECT_EQ(rig->unused.size(), single->unused.size());
  const Eigen::MatrixXd& of_single = single->refined->covariance.matrix;
  const Eigen::MatrixXd& of_rig = rig->refined->covariance.matrix;
  ASSERT_EQ(of_single.rows(), of_rig.rows());
  const Tangent6 difference =
      LocalCoordinates(single->refined->hand_eye.camera_mount_from_camera, rig->refined->poses.mount_from_camera[0]);
  for (Eigen::Index i = 0; i < of_single.rows(); ++i) {
    EXPECT_NEAR(std::sqrt(of_rig(i, i) / of_single(i, i)), 1, 0.01) << i;
  }
  for (Eigen::Index i = 0; i < 6; ++i) {
    EXPECT_LT(std::abs(difference[i]), 1e-3 * std::sqrt(of_single(i, i))) << i;
  }
  EXPECT_NEAR(rig->refined->pixel_sigmas_px[0] / single->refined->pixel_sigma_px, 1, 1e-3);
  EXPECT_NEAR(rig->refined->robot_noise[0]->translation_m, single->refined->robot_noise->translation_m, 1e-6);
  EXPECT_EQ(rig->refined->image_sigmas_px[0], 0);
}

INSTANTIATE_TEST_SUITE_P(Scenes, SingleCameraTest,
                         testing::Values(Kind{"noisy", Setup::kEyeToHand, 1e-4, 3e-4, kDesigned},
                                         Kind{"noisy_in_hand", Setup::kEyeInHand, 2e-4, 5e-4, kDesigned},
                                         Kind{"bent", Setup::kEyeToHand, 1e-4, 3e-4, {1, 1, 2e-3, 1e-3}},
                                         Kind{
                                             "stretched_in_hand", Setup::kEyeInHand, 1e-4, 3e-4, {1.003, 1.002, 0, 0}}),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace heba
