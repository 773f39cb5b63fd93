// Tests of errors of the arms' kinematics in the calibration of a rig.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "heba/calibration.h"
#include "tests/support/cell_arm_scenes.h"

namespace heba {
namespace {

constexpr ArmErrorSigmas kErrors = {DegToRad(0.05), 0.3e-3, DegToRad(0.03), 0};

CellSceneSetting Setting(int num_captures) {
  CellSceneSetting setting;
  setting.num_captures = num_captures;
  setting.robot_noise = {0.02e-3, DegToRad(0.004), 0};
  return setting;
}

Calibration Calibrated(const CellArmScene& scene, std::vector<ArmErrorModels> arms,
                       SmoothPoseErrors smooth = SmoothPoseErrors::kNone) {
  CalibrationOptions options;
  options.has_camera.assign(scene.rig.problem.cameras.size(), true);
  options.smooth = smooth;
  options.arms = std::move(arms);
  Outcome<Calibration> calibration = Calibrate(scene.rig.problem, options);
  CHECK(calibration.ok()) << calibration.reason();
  CHECK(calibration->refined.ok()) << calibration->refined.reason();
  return std::move(*calibration);
}

// Adds the errors of the poses of the cameras in each other, which no error of an arm's base or flange reaches.
void Add(const CellScene& scene, const Calibration& calibration, PoseErrorSums* errors) {
  for (const RelativePose& pose : RelativeCameraPoses(calibration.problem, *calibration.refined)) {
    std::vector<Rigid3d> ends;
    for (const std::string& name : {pose.parent, pose.child}) {
      for (size_t c = 0; c < scene.problem.cameras.size(); ++c) {
        if (scene.problem.cameras[c].name == name) ends.push_back(scene.truth.mount_from_camera[c]);
      }
    }
    errors->Add(pose.parent_from_child, Inverse(ends[0]) * ends[1], pose.covariance);
  }
}

// Returns the RMS over all captures of the distance between the true position of a gripper and that which a solution
// gives it, of which the common part is taken out: it belongs to the base and the tool.
double GripperErrorM(const CellArmScene& scene, size_t robot, const Calibration* calibration) {
  std::vector<Rigid3d> residual;
  for (size_t i = 0; i < scene.rig.arms.size(); ++i) {
    const ProblemCapture& capture = (calibration != nullptr ? calibration->problem : scene.rig.problem).captures[i];
    const Rigid3d stated = calibration != nullptr ? WithErrors(capture, calibration->refined->effects)[robot]
                                                  : capture.base_from_gripper[robot];
    residual.push_back(Inverse(scene.rig.arms[i][robot]) * stated);
  }
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Rigid3d& pose : residual) mean += pose.translation / static_cast<double>(residual.size());
  double squares_m2 = 0;
  for (const Rigid3d& pose : residual) squares_m2 += (pose.translation - mean).squaredNorm();
  return std::sqrt(squares_m2 / static_cast<double>(residual.size()));
}

TEST(CellArmsNightly, TheErrorsOfAnArmAreEstimatedAndTheCovarianceIsHonest) {
  constexpr int kTrials = 5;
  PoseErrorSums with_arm;
  PoseErrorSums without;
  for (uint64_t trial = 0; trial < kTrials; ++trial) {
    const CellSceneSetting setting = Setting(30);
    const CellArmScene scene = WithArms(ReachableCell(100 + trial, setting), setting, kErrors, 7 + trial);
    const Calibration found = Calibrated(scene, ErrorsOf(scene));
    ASSERT_EQ(found.arms.size(), 1U);
    ASSERT_NE(found.arms.front().model, nullptr) << found.arms.front().reason.ToString();
    const RobotNoise& noise = *found.refined->robot_noise[0];
    EXPECT_LT(noise.translation_m, 0.1e-3);
    EXPECT_GT(found.arms.front().noise_before->translation_m, 3 * noise.translation_m);
    // The noise of the poses alone is 0.035 mm.
    EXPECT_LT(GripperErrorM(scene, 0, &found), 0.3 * GripperErrorM(scene, 0, nullptr));
    Add(scene.rig, found, &with_arm);
    Add(scene.rig, Calibrated(scene, {}), &without);
  }
  const double mean_chi2 = with_arm.chi2 / with_arm.num_poses;
  std::printf("mean chi-square %.2f (6), without the errors %.2f; errors %.4f and %.4f mm\n", mean_chi2,
              without.chi2 / without.num_poses, 1000 * std::sqrt(with_arm.squares_m2 / with_arm.num_poses),
              1000 * std::sqrt(without.squares_m2 / without.num_poses));
  // The mean of five chi-squares with six degrees of freedom has a standard deviation of 1.55.
  EXPECT_LT(mean_chi2, 11);
  EXPECT_LT(with_arm.squares_m2, without.squares_m2);
}

TEST(CellArmsTest, AnArmWithoutErrorsIsDeclinedAndTheResultIsTheSame) {
  const CellSceneSetting setting = Setting(25);
  const CellArmScene scene = WithArms(ReachableCell(3, setting), setting, {}, 5);
  const Calibration found = Calibrated(scene, ErrorsOf(scene));
  ASSERT_EQ(found.arms.size(), 1U);
  EXPECT_EQ(found.arms.front().model, nullptr);
  EXPECT_EQ(found.arms.front().reason.code, "no_better_than_noise");
  const Calibration plain = Calibrated(scene, {});
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_LT(DistanceM(found.refined->poses.mount_from_camera[c], plain.refined->poses.mount_from_camera[c]), 1e-9);
  }
}

// The stated joints belong to other captures, so that they explain none of the errors that the arm has.
TEST(CellArmsTest, ADeclinedArmHasTheErrorsAndTheShapesOfOneThatIsNotNamed) {
  const CellSceneSetting setting = Setting(40);
  CellArmScene scene = WithArms(ReachableCell(3, setting), setting, {}, 5);
  AddSmoothErrors({0.2e-3, DegToRad(0.04), 0}, {}, 6, &scene.rig);
  std::vector<ArmErrorModels> arms = ErrorsOf(scene);
  std::vector<std::shared_ptr<const PoseEffect>>& effects = arms.front().effects_of_captures.front();
  std::rotate(effects.begin(), effects.begin() + 7, effects.end());
  const Calibration found = Calibrated(scene, arms, SmoothPoseErrors::kAuto);
  ASSERT_EQ(found.arms.size(), 1U);
  ASSERT_EQ(found.arms.front().model, nullptr);
  const Calibration plain = Calibrated(scene, {}, SmoothPoseErrors::kAuto);
  ASSERT_EQ(plain.smooth_errors.size(), 1U);
  ASSERT_EQ(found.smooth_errors.size(), 1U);
  EXPECT_NEAR(std::log(found.smooth_errors.front().p_value_without),
              std::log(plain.smooth_errors.front().p_value_without), 1e-3);
  for (size_t t = 0; t < plain.problem.targets.size(); ++t) {
    EXPECT_EQ(found.problem.targets[t].free_shape, plain.problem.targets[t].free_shape);
  }
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_LT(DistanceM(found.refined->poses.mount_from_camera[c], plain.refined->poses.mount_from_camera[c]), 1e-9);
  }
}

TEST(CellArmsTest, EachOfTwoArmsHasItsOwnErrors) {
  const CellSceneSetting setting = Setting(40);
  const CellArmScene scene = WithArms(TwoArmCell(11, setting), setting, kErrors, 13);
  const Calibration found = Calibrated(scene, ErrorsOf(scene));
  ASSERT_EQ(found.arms.size(), 2U);
  for (size_t r = 0; r < 2; ++r) {
    ASSERT_NE(found.arms[r].model, nullptr) << found.arms[r].reason.ToString();
    EXPECT_LT(GripperErrorM(scene, r, &found), 0.4 * GripperErrorM(scene, r, nullptr)) << "arm " << r;
  }
}

TEST(CellArmsTest, TheConfigurationOfRecoveredJointsIsFound) {
  const CellSceneSetting setting = Setting(30);
  const CellArmScene scene = WithArms(FourCameraCell(21, setting), setting, kErrors, 23);
  std::vector<ArmErrorModels> errors = ErrorsOf(scene);
  // Joints of another posture than the true one, as another configuration would have.
  std::vector<std::shared_ptr<const PoseEffect>> wrong;
  for (const std::vector<Eigen::VectorXd>& joints : scene.joints) {
    Eigen::VectorXd other = joints[0].reverse();
    wrong.push_back(MakeArmEffect(scene.arms[0]->nominal, other, scene.arms[0]->tip_from_gripper));
  }
  errors[0].effects_of_captures.insert(errors[0].effects_of_captures.begin(), std::move(wrong));
  const Calibration found = Calibrated(scene, errors);
  EXPECT_EQ(found.arms.front().branches, std::vector<size_t>(found.problem.captures.size(), 1));
  EXPECT_NE(found.arms.front().model, nullptr);
}

TEST(CellArmsTest, ModelsThatAreAskedForAreEstimatedWithoutAChoice) {
  const CellSceneSetting setting = Setting(25);
  const CellArmScene scene = WithArms(ReachableCell(31, setting), setting, {}, 33);
  std::vector<ArmErrorModels> errors = ErrorsOf(scene);
  errors[0].is_chosen = false;
  const Calibration found = Calibrated(scene, errors);
  EXPECT_EQ(found.arms.front().model, errors[0].models.back());
  EXPECT_TRUE(found.arms.front().alternatives.empty());
}

}  // namespace
}  // namespace heba
