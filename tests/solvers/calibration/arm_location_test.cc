// The location of targets, and their reach, with the estimated errors of an arm.
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "heba/bundle_adjustment.h"
#include "heba/robot/arm_postures.h"
#include "heba/target_location.h"
#include "tests/support/arm_scenes.h"

namespace heba {
namespace {

// A calibrated cell with an arm, and an image of a target that is no part of the calibration.
struct Cell {
  ArmScene arm;
  Rigid3d tip_from_gripper;
  Solution solution;
  StatedPose camera_mount;
  Observations seen;
  Rigid3d base_from_target;  // True.
  Rng rng;

  StatedPose Stated(const Eigen::VectorXd& joints) const {
    return {BaseFromGripper(arm.nominal, joints, tip_from_gripper),
            MakeArmEffect(arm.nominal, joints, tip_from_gripper)};
  }
  // Returns where the gripper truly is, with the noise of the joints.
  Rigid3d TruePose(const Eigen::VectorXd& joints) {
    Eigen::VectorXd reached = joints;
    for (double& joint : reached) joint += ArmSceneOptions().joint_noise_rad * rng.Normal();
    return BaseFromGripper(WithChanges(arm.nominal, arm.errors), reached, tip_from_gripper);
  }
};

std::optional<Cell> Calibrated(Setup setup, uint64_t seed) {
  ArmSceneOptions options;
  options.setup = setup;
  options.has_several_configurations = false;
  Cell cell{MakeArmScene(seed, options), {}, {}, {}, {}, {}, Rng(1000 + seed)};
  const TestScene& scene = cell.arm.scene;
  BundleOptions bundle;
  bundle.loss = LossKind::kNone;
  bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  bundle.effects = std::make_shared<const SharedEffects>(ArmErrors(cell.arm.nominal, ArmErrorModel::kGeometry));
  Outcome<Solution> solution = RefineHandEye({scene.camera, scene.views, setup}, scene.hand_eye, bundle);
  if (!solution) return std::nullopt;
  cell.solution = std::move(*solution);
  const Eigen::VectorXd& joints = cell.arm.joints[seed % cell.arm.joints.size()];
  const View& view = scene.views[seed % cell.arm.joints.size()];
  cell.tip_from_gripper = Inverse(BaseFromTip(cell.arm.nominal, joints)) * GripperPoseOf(setup, view).base_from_mount;
  const Rigid3d base_from_gripper = cell.TruePose(joints);
  const Rigid3d mount = CameraMountFromTargetMount(setup, base_from_gripper);
  const std::optional<View> seen =
      SimulateView("seen", scene.camera, scene.hand_eye, mount, TestSceneOptions().points, options.noise_px, &cell.rng);
  if (!seen) return std::nullopt;
  cell.seen = seen->observations;
  const bool is_carried = setup == Setup::kEyeInHand;
  if (is_carried) cell.camera_mount = cell.Stated(joints);
  cell.base_from_target = (is_carried ? base_from_gripper : Rigid3d()) * scene.hand_eye.camera_mount_from_camera *
                          CameraFromTarget(scene.hand_eye, mount);
  return cell;
}

double ChiSquare(const Eigen::Vector3d& off_m, const Eigen::Matrix3d& covariance_m2) {
  return off_m.dot(covariance_m2.ldlt().solve(off_m));
}

class ArmLocationTest : public testing::TestWithParam<Setup> {};
INSTANTIATE_TEST_SUITE_P(, ArmLocationTest, testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                         [](const auto& test) { return std::string(SetupName(test.param)); });

// The gripper is sent to a pose above the located target, in the configuration of the captures and with the wrist, the
// elbow or the shoulder flipped. The mean of 40 chi-squares with 3 degrees of freedom is within 4 sigmas (of 0.39)
// of 3.
TEST_P(ArmLocationTest, ErrorsOfLocationAndReachAgreeWithTheStatedCovariance) {
  constexpr int kSeeds = 25;
  double located_sum = 0;
  double captured_sum = 0;
  double flipped_sum = 0;
  double captured_m2 = 0;
  double flipped_m2 = 0;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    std::optional<Cell> cell = Calibrated(GetParam(), seed);
    ASSERT_TRUE(cell.has_value());
    const Outcome<LocatedTarget> located = LocateTarget(GetParam(), cell->solution, cell->seen, cell->camera_mount);
    ASSERT_TRUE(located.ok()) << located.reason();
    const Eigen::Vector3d middle = cell->seen.points_in_target.rowwise().mean();
    located_sum +=
        ChiSquare(located->base_from_target * middle - cell->base_from_target * middle, located->covariance.TotalM2());
    const Eigen::VectorXd& near = cell->arm.joints[(seed + 7) % cell->arm.joints.size()];
    const Arm& nominal = cell->arm.nominal;
    const Outcome<std::vector<Eigen::VectorXd>> postures = PosturesOf(nominal, BaseFromTip(nominal, near));
    ASSERT_TRUE(postures.ok()) << postures.reason();
    const std::optional<Configuration> common = ConfigurationOf(nominal, near);
    const auto flipped = std::find_if(postures->begin(), postures->end(),
                                      [&](const auto& joints) { return ConfigurationOf(nominal, joints) != common; });
    ASSERT_NE(flipped, postures->end());
    for (const bool is_flipped : {false, true}) {
      const Eigen::VectorXd& joints = is_flipped ? *flipped : near;
      const StatedPose command = cell->Stated(joints);
      const Eigen::Vector3d stated_m = Correct(cell->solution, command).base_from_mount.translation;
      const Eigen::Vector3d true_m = cell->TruePose(joints).translation;
      const Eigen::Vector3d off_m =
          (true_m - cell->base_from_target * middle) - (stated_m - located->base_from_target * middle);
      const PositionCovariance covariance =
          CovarianceOfReach(cell->solution, *located, command, Eigen::Vector3d::Zero(), middle);
      (is_flipped ? flipped_sum : captured_sum) += ChiSquare(off_m, covariance.TotalM2());
      (is_flipped ? flipped_m2 : captured_m2) += covariance.by_calibration_m2.trace();
    }
  }
  EXPECT_NEAR(located_sum / kSeeds, 3, 2.0);
  EXPECT_NEAR(captured_sum / kSeeds, 3, 2.0);
  EXPECT_NEAR(flipped_sum / kSeeds, 3, 2.0);
  EXPECT_GT(flipped_m2, 2 * captured_m2);
}

// The derivatives by the arm's errors are those of differences: the rounding of a step of 1e-6 is 1e-9.
TEST_P(ArmLocationTest, DerivativesByTheArmAreThoseOfDifferences) {
  const std::optional<Cell> cell = Calibrated(GetParam(), 3);
  ASSERT_TRUE(cell.has_value());
  const Solution& solution = cell->solution;
  const Eigen::Index first = solution.covariance.layout.Block(kRobotBlock).first;
  const auto locate = [&](const Solution& with) {
    return LocateTarget(GetParam(), with, cell->seen, cell->camera_mount)->base_from_target.translation;
  };
  const Outcome<LocatedTarget> located = LocateTarget(GetParam(), solution, cell->seen, cell->camera_mount);
  ASSERT_TRUE(located.ok()) << located.reason();
  const Eigen::Vector3d origin = located->base_from_target.translation;
  const StatedPose command = cell->Stated(cell->arm.joints[5]);
  const CorrectedPose corrected = Correct(solution, command);
  constexpr double kStep = 1e-6;
  for (Eigen::Index i = 0; i < solution.effects.size(); ++i) {
    Solution moved = solution;
    moved.effects[i] += kStep;
    const Eigen::Vector3d target = PointByMotion(origin) * located->motion.by_unknowns.col(first + i);
    EXPECT_LT(((locate(moved) - origin) / kStep - target).norm(), 1e-4);
    const Tangent6 tangent =
        LocalCoordinates(corrected.base_from_mount, Correct(moved, command).base_from_mount) / kStep;
    EXPECT_LT((tangent - corrected.by_unknowns.col(first + i)).norm(), 1e-4);
  }
}

}  // namespace
}  // namespace heba
