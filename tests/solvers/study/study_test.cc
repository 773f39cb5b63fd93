// Tests of the studies: the error bound equals that of an independent formula, the refinement reaches it, and a trial
// is reproducible from its number.
#include "solvers/study/study.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "heba/base/units.h"
#include "heba/robot/arm_postures.h"
#include "tests/support/arm_scenes.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

StudyCell MakeCell(Setup setup, double pixel_sigma_px, const RobotNoise& robot) {
  TestSceneOptions options;
  options.setup = setup;
  options.num_captures = 15;
  options.points = GridPoints(4, 3, 0.04);
  const TestScene scene = MakeTestScene(2, options);
  StudyCell cell;
  const Observations& points = scene.views.front().observations;
  cell.problem = HandEyeProblem(setup, scene.camera, DesignedShape(points.points_in_target));
  cell.poses = HandEyePosesOf(scene.hand_eye);
  cell.targets = {{points}};
  for (const PosePair& pair : scene.pairs) cell.captures.push_back({{CaptureRole::kNone, pair.camera_from_target}});
  cell.pixel_sigma_px = pixel_sigma_px;
  cell.robot_noise = robot;
  return cell;
}

// Returns the estimates of a trial.
std::vector<TrialEstimate> OnlyTrial(const StudyCell& cell, int trial) { return RunTrial(cell, 1, trial).at(0); }

// Returns the summary of the bundle adjustment over trials.
MethodSummary BundleOf(const StudyCell& cell, int num_trials) {
  std::vector<std::vector<std::vector<TrialEstimate>>> trials;
  for (int trial = 0; trial < num_trials; ++trial) trials.push_back(RunTrial(cell, 1, trial));
  return Summarise(cell, trials).at(0).methods.back();
}

Outcome<StudyErrors> BoundOf(const StudyCell& cell) {
  const Outcome<std::vector<PoseBound>> bounds = ErrorBounds(cell);
  return bounds ? Outcome<StudyErrors>(bounds->at(0).errors) : Outcome<StudyErrors>(Failure{bounds.reason()});
}

// Returns all pixels of a capture after a step of the hand-eye pose (6), the board pose (6) and the robot error of
// this capture (6). It is differentiated numerically.
Eigen::VectorXd PixelsOf(const StudyCell& cell, size_t capture, const Eigen::Matrix<double, 18, 1>& step) {
  const HandEye truth = HandEyeOf(cell);
  const HandEye moved{Retract(truth.camera_mount_from_camera, step.head<6>()),
                      Retract(truth.target_mount_from_target, step.segment<6>(6))};
  const Rigid3d mount = CameraMountFromTargetMount(truth, cell.captures[capture].seen.camera_from_target);
  const Rigid3d base_from_gripper = Retract(BaseFromGripper(SetupOf(cell), mount), step.tail<6>());
  const Rigid3d camera_from_target =
      CameraFromTarget(moved, CameraMountFromTargetMount(SetupOf(cell), base_from_gripper));
  const Points3& points = cell.targets[0].points.points_in_target;
  Eigen::VectorXd pixels(2 * points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    pixels.segment<2>(2 * i) = ProjectPoint(cell.problem.cameras[0].camera, camera_from_target * points.col(i)).value();
  }
  return pixels;
}

class StudyTest : public testing::TestWithParam<Setup> {};

TEST_P(StudyTest, ErrorBoundEqualsItsDefinition) {
  const RobotNoise robot{2e-4, 4e-4};
  const StudyCell cell = MakeCell(GetParam(), 0.3, robot);
  Eigen::Matrix<double, 12, 12> information = Eigen::Matrix<double, 12, 12>::Zero();
  for (size_t capture = 0; capture < cell.captures.size(); ++capture) {
    Eigen::MatrixXd jacobian(2 * cell.targets[0].points.size(), 18);
    for (int k = 0; k < 18; ++k) {
      constexpr double kStep = 1e-6;
      const Eigen::Matrix<double, 18, 1> step = kStep * Eigen::Matrix<double, 18, 1>::Unit(k);
      jacobian.col(k) = (PixelsOf(cell, capture, step) - PixelsOf(cell, capture, -step)) / (2 * kStep);
    }
    Eigen::Matrix<double, 6, 1> q;
    q << Eigen::Vector3d::Constant(robot.translation_m * robot.translation_m),
        Eigen::Vector3d::Constant(robot.rotation_rad * robot.rotation_rad);
    const Eigen::MatrixXd s = 0.09 * Eigen::MatrixXd::Identity(jacobian.rows(), jacobian.rows()) +
                              jacobian.rightCols<6>() * q.asDiagonal() * jacobian.rightCols<6>().transpose();
    information += jacobian.leftCols<12>().transpose() * s.inverse() * jacobian.leftCols<12>();
  }
  const Eigen::Matrix<double, 12, 12> covariance = information.inverse();
  const Outcome<StudyErrors> bound = BoundOf(cell);
  ASSERT_TRUE(bound.ok()) << bound.reason();
  constexpr double kNumeric = 1e-4;  // Relative error of the central differences.
  EXPECT_NEAR(bound->hand_eye_m / std::sqrt(covariance.diagonal().head<3>().sum()), 1, kNumeric);
  EXPECT_NEAR(bound->hand_eye_rad / std::sqrt(covariance.diagonal().segment<3>(3).sum()), 1, kNumeric);
  EXPECT_NEAR(*bound->board_m / std::sqrt(covariance.diagonal().segment<3>(6).sum()), 1, kNumeric);
  EXPECT_NEAR(*bound->board_rad / std::sqrt(covariance.diagonal().tail<3>().sum()), 1, kNumeric);
}

// 200 trials determine an RMS of three numbers to about 4 % and a coverage of 95 % to 1.5 %; the tolerances are three
// times these.
TEST_P(StudyTest, RefinementReachesTheBoundWithCorrectCoverage) {
  constexpr int kTrials = 200;
  for (const bool is_noisy : {false, true}) {
    // Robot noise is tested with the harder of the two setups only.
    if (is_noisy && GetParam() == heba::Setup::kEyeToHand) continue;
    SCOPED_TRACE(is_noisy);
    StudyCell cell = MakeCell(GetParam(), 0.3, is_noisy ? RobotNoise{2e-4, 4e-4} : RobotNoise{});
    if (is_noisy) cell.options.bundle.robot = BundleOptions::Robot::kEstimatedNoise;
    const MethodSummary bundle = BundleOf(cell, kTrials);
    EXPECT_EQ(bundle.method, kBundleMethod);
    EXPECT_EQ(bundle.num_failed, 0);
    const Outcome<StudyErrors> bound = BoundOf(cell);
    EXPECT_NEAR(bundle.rms.hand_eye_m / bound->hand_eye_m, 1, 0.12);
    EXPECT_NEAR(bundle.rms.hand_eye_rad / bound->hand_eye_rad, 1, 0.12);
    EXPECT_NEAR(*bundle.coverage, 0.95, 0.05);
    EXPECT_NEAR(*bundle.pixel_sigma_px, 0.3, 0.01);
  }
}

// Captures at one pose share the error of the robot: four of them are worth one with half of the pixel noise.
TEST_P(StudyTest, RepeatedPosesShareTheErrorOfTheRobot) {
  constexpr int kTrials = 60;
  StudyCell cell = MakeCell(GetParam(), 0.3, {2e-4, 4e-4});
  cell.options.bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  cell.num_repeats = 4;
  StudyCell once = cell;
  once.num_repeats = 1;
  once.pixel_sigma_px = 0.15;
  const Outcome<StudyErrors> bound = BoundOf(cell);
  EXPECT_NEAR(bound->hand_eye_m, BoundOf(once)->hand_eye_m, 1e-6 * bound->hand_eye_m);
  const MethodSummary bundle = BundleOf(cell, kTrials);
  EXPECT_NEAR(bundle.rms.hand_eye_m / bound->hand_eye_m, 1, 0.2);
  EXPECT_NEAR(*bundle.pixel_sigma_px, 0.3, 0.01);
}

TEST_P(StudyTest, TrialsAreReproducible) {
  const StudyCell cell = MakeCell(GetParam(), 0.3, {});
  const std::vector<TrialEstimate> once = OnlyTrial(cell, 7);
  const std::vector<TrialEstimate> again = OnlyTrial(cell, 7);
  const std::vector<TrialEstimate> other = OnlyTrial(cell, 8);
  EXPECT_EQ(once.back().error, again.back().error);
  EXPECT_NE(once.back().error, other.back().error);
}

INSTANTIATE_TEST_SUITE_P(Setups, StudyTest, testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                         [](const auto& test) { return std::string(SetupName(test.param)); });

TEST(StudyIntrinsicsTest, ErrorsCoverTheParametersThatEachMethodEstimates) {
  StudyCell cell = MakeCell(Setup::kEyeToHand, 0.1, {});
  cell.problem.cameras[0].free_intrinsics = {ParameterGroup::kFocal};
  cell.gives_cameras = false;
  for (const TrialEstimate& estimate : OnlyTrial(cell, 0)) {
    EXPECT_TRUE(estimate.ok) << estimate.method;
    EXPECT_EQ(estimate.error.size(), estimate.method == "bundle" ? 14 : 12) << estimate.method;
  }
}

// Returns a posture in another configuration that reaches the same pose.
Eigen::VectorXd OtherPosture(const ArmScene& scene, const Eigen::VectorXd& joints) {
  const Outcome<std::vector<Eigen::VectorXd>> postures = PosturesOf(scene.nominal, BaseFromTip(scene.nominal, joints));
  CHECK(postures.ok()) << postures.reason();
  for (const Eigen::VectorXd& posture : *postures) {
    const bool is_singular = !SingularityAt(scene.nominal, posture).empty();
    if (!is_singular && ConfigurationOf(scene.nominal, posture) != ConfigurationOf(scene.nominal, joints)) {
      return posture;
    }
  }
  LOG(FATAL) << "the pose is reached in one configuration only";
}

// A cell whose robot is an arm with errors: the captures of one configuration, and places in it and in another one.
StudyCell MakeArmCell(double share_of_errors) {
  ArmSceneOptions options;
  options.has_several_configurations = false;
  options.num_captures = 30;
  options.offset_rad = options.length_m = options.angle_rad = options.joint_noise_rad = 0;
  const ArmScene scene = MakeArmScene(3, options);
  StudyCell cell;
  const Observations& points = scene.scene.views.front().observations;
  cell.problem = HandEyeProblem(Setup::kEyeToHand, scene.scene.camera, DesignedShape(points.points_in_target));
  cell.poses = HandEyePosesOf(scene.scene.hand_eye);
  cell.targets = {{points}};
  cell.pixel_sigma_px = 0.1;
  cell.options.methods = {"shah"};
  cell.options.choose.target_shape = false;
  SharedEffects errors = ArmErrors(scene.nominal, ArmErrorModel::kGeometry);
  errors.groups[0].sigma = share_of_errors * DegToRad(0.05);
  errors.groups[1].sigma = share_of_errors * 0.3e-3;
  errors.groups[2].sigma = share_of_errors * DegToRad(0.03);
  StudyRobot robot;
  for (size_t i = 0; i < scene.scene.views.size(); ++i) {
    const View& view = scene.scene.views[i];
    const bool is_capture = i < 20;
    if (is_capture) {
      cell.captures.push_back(
          {{CaptureRole::kNone, CameraFromTarget(scene.scene.hand_eye, view.camera_mount_from_target_mount)}});
      robot.effects.push_back(view.effect);
      robot.gripper_by_joints.push_back(view.gripper_by_joints);
      continue;
    }
    robot.places.push_back({view.camera_mount_from_target_mount, view.effect, view.gripper_by_joints, true});
    const Rigid3d mount = view.camera_mount_from_target_mount;
    const Eigen::VectorXd flipped = OtherPosture(scene, scene.joints[i]);
    robot.places.push_back({mount, MakeArmEffect(scene.nominal, flipped, scene.tip_from_gripper),
                            GripperByJoints(scene.nominal, flipped, scene.tip_from_gripper), false});
  }
  for (const ArmErrorModel model : {ArmErrorModel::kOffsets, ArmErrorModel::kGeometry}) {
    cell.options.choose.effects.push_back(std::make_shared<const SharedEffects>(ArmErrors(scene.nominal, model)));
  }
  robot.errors = std::make_shared<const SharedEffects>(std::move(errors));
  cell.robot = std::move(robot);
  return cell;
}

// The predictions reach the bound, which is larger in a configuration without captures, and their regions hold the
// truth.
TEST(StudyArmTest, PredictionsReachTheBoundInsideAndOutside) {
  const StudyCell cell = MakeArmCell(1);
  const Outcome<StudyErrors> bound = BoundOf(cell);
  ASSERT_TRUE(bound.ok()) << bound.reason();
  ASSERT_TRUE(bound->inside_m && bound->outside_m);
  EXPECT_GT(*bound->outside_m, 1.5 * *bound->inside_m);
  const MethodSummary bundle = BundleOf(cell, 30);
  EXPECT_EQ(bundle.method, "bundle");
  EXPECT_EQ(bundle.estimated_effects, 1.0);
  EXPECT_EQ(bundle.right_model, 1.0);
  // The errors of a trial are common to all places: 30 trials know their size to about 10 %.
  EXPECT_LT(*bundle.rms.inside_m, 1.3 * *bound->inside_m);
  EXPECT_LT(*bundle.rms.outside_m, 1.3 * *bound->outside_m);
  EXPECT_GT(*bundle.rms.inside_m, 0.7 * *bound->inside_m);
  EXPECT_GT(*bundle.coverage_inside, 0.88);
  EXPECT_GT(*bundle.coverage_outside, 0.88);
}

TEST(StudyArmTest, ExactArmIsLeftAlone) {
  const StudyCell cell = MakeArmCell(0);
  const Outcome<StudyErrors> bound = BoundOf(cell);
  ASSERT_TRUE(bound.ok()) << bound.reason();
  const MethodSummary bundle = BundleOf(cell, 20);
  EXPECT_LE(*bundle.estimated_effects, 0.1);
  EXPECT_LT(bundle.rms.hand_eye_m, 1.3 * bound->hand_eye_m);
}

}  // namespace
}  // namespace heba
