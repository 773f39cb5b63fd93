// The location of targets, and their reach, with the estimated errors of an arm.
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "heba/bundle_adjustment.h"
#include "heba/robot/arm_postures.h"
#include "heba/simulation/arm_captures.h"
#include "heba/target_location.h"
#include "tests/support/arm_scenes.h"

namespace heba {
namespace {

// A calibrated cell with an arm whose errors have the standard deviations of ArmSceneOptions.
struct Cell {
  Setup setup = Setup::kEyeToHand;
  ArmScene arm;
  PairSolution solution;
  Rng rng;

  StatedPose Stated(const Eigen::VectorXd& joints) const {
    return {BaseFromGripper(arm.nominal, joints, arm.tip_from_gripper),
            MakeArmEffect(arm.nominal, joints, arm.tip_from_gripper),
            GripperByJoints(arm.nominal, joints, arm.tip_from_gripper)};
  }
  // Returns where the gripper truly is, with the noise of the joints.
  Rigid3d TruePose(const Eigen::VectorXd& joints) {
    Eigen::VectorXd reached = joints;
    for (double& joint : reached) joint += ArmSceneOptions().joint_noise_rad * rng.Normal();
    return BaseFromGripper(WithChanges(arm.nominal, arm.errors), reached, arm.tip_from_gripper);
  }
};

// An image of a target that is no part of the calibration. The camera sees it as in the first capture.
struct Sight {
  Observations seen;
  StatedPose camera_mount;
  Rigid3d base_from_target;  // True.
};

// Returns what the camera sees if the arm stands like this.
Sight SightAt(const Eigen::VectorXd& joints, Cell* cell) {
  const TestScene& scene = cell->arm.scene;
  const Rigid3d camera_from_target =
      CameraFromTarget(scene.hand_eye, scene.views.front().camera_mount_from_target_mount);
  const std::optional<View> view = SimulateView("seen", scene.camera, HandEye(), camera_from_target,
                                                TestSceneOptions().points, ArmSceneOptions().noise_px, cell->rng);
  CHECK(view.has_value());
  const bool is_carried = cell->setup == Setup::kEyeInHand;
  const Rigid3d base_from_mount = is_carried ? cell->TruePose(joints) : Rigid3d();
  return {view->observations, is_carried ? cell->Stated(joints) : StatedPose(),
          base_from_mount * scene.hand_eye.camera_mount_from_camera * camera_from_target};
}

// How the standard deviations of the noise and of the arm's errors are known.
enum class Sigmas { kGiven, kEstimated };

std::optional<Cell> Calibrated(Setup setup, Sigmas sigmas, uint64_t seed) {
  ArmSceneOptions options;
  options.setup = setup;
  options.has_several_configurations = false;
  Cell cell{setup, MakeArmScene(seed, options), {}, Rng(100000 + seed)};
  const TestScene& scene = cell.arm.scene;
  BundleOptions bundle;
  bundle.loss = LossKind::kNone;
  bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  SharedEffects errors = ArmErrors(cell.arm.nominal, ArmErrorModel::kGeometry);
  if (sigmas == Sigmas::kGiven) {
    bundle.pixel_noise_px = options.noise_px;
    bundle.robot = BundleOptions::Robot::kGivenNoise;
    bundle.robot_noise.joint_rad = options.joint_noise_rad;
    errors.groups[0].sigma = options.offset_rad;
    errors.groups[1].sigma = options.length_m;
    errors.groups[2].sigma = options.angle_rad;
  }
  bundle.effects = std::make_shared<const SharedEffects>(std::move(errors));
  Outcome<PairSolution> solution = RefineHandEye({scene.camera, scene.views, setup}, scene.hand_eye, bundle);
  if (!solution) return std::nullopt;
  cell.solution = std::move(*solution);
  return cell;
}

// Returns a posture anywhere in the workspace.
Eigen::VectorXd AnyPosture(const Arm& arm, Rng& rng) {
  Eigen::VectorXd joints(arm.num_joints());
  do {
    for (double& joint : joints) joint = rng.Uniform(-kPi, kPi);
  } while (!SingularityAt(arm, joints).empty());
  return joints;
}

// Returns a posture in another configuration that reaches the same pose.
Eigen::VectorXd FlippedPosture(const Arm& arm, const Eigen::VectorXd& joints) {
  const Outcome<std::vector<Eigen::VectorXd>> postures = PosturesOf(arm, BaseFromTip(arm, joints));
  CHECK(postures.ok()) << postures.reason();
  const auto flipped = std::find_if(postures->begin(), postures->end(), [&](const Eigen::VectorXd& other) {
    return ConfigurationOf(arm, other) != ConfigurationOf(arm, joints);
  });
  CHECK(flipped != postures->end());
  return *flipped;
}

// The errors of positions against their stated covariances, over many cells.
struct LocationAgreement {
  double chi_square_sum = 0;
  std::vector<double> p_values = {};
  double by_calibration_m2 = 0;

  void Add(const Eigen::Vector3d& off_m, const PositionCovariance& covariance, double dof) {
    const double chi_square = MahalanobisSquare(off_m, covariance.TotalM2());
    chi_square_sum += chi_square;
    p_values.push_back(FisherTail(chi_square / 3, 3, dof));
    by_calibration_m2 += covariance.by_calibration_m2.trace();
  }
};

// Targets are located from a posture of the captures and from anywhere. The gripper is sent above the first of them, in
// the configuration of the captures and in another one.
std::map<std::string, LocationAgreement> AgreementsOf(Setup setup, Sigmas sigmas, int num_trials) {
  std::map<std::string, LocationAgreement> agreements;
  for (uint64_t seed = 1; seed <= static_cast<uint64_t>(num_trials); ++seed) {
    std::optional<Cell> cell = Calibrated(setup, sigmas, seed);
    if (!cell) {
      ADD_FAILURE() << "seed " << seed;
      continue;
    }
    const double dof = cell->solution.covariance_dof;
    const Arm& nominal = cell->arm.nominal;
    const std::vector<Eigen::VectorXd>& captured = cell->arm.joints;
    const auto locate = [&](const Sight& sight) {
      Outcome<LocatedTarget> located = LocateTarget(setup, cell->solution, sight.seen, sight.camera_mount);
      CHECK(located.ok()) << located.reason();
      return *located;
    };
    const Sight far = SightAt(AnyPosture(nominal, cell->rng), &*cell);
    const Sight near = SightAt(captured[seed % captured.size()], &*cell);
    const Eigen::Vector3d middle = near.seen.points_in_target.rowwise().mean();
    const auto off_m = [&](const LocatedTarget& located, const Sight& sight) -> Eigen::Vector3d {
      return located.world_from_target * middle - sight.base_from_target * middle;
    };
    const LocatedTarget located_far = locate(far);
    agreements["located from anywhere"].Add(off_m(located_far, far), located_far.covariance, dof);
    const LocatedTarget located = locate(near);
    agreements["located"].Add(off_m(located, near), located.covariance, dof);
    const Eigen::VectorXd& sent = captured[(seed + 7) % captured.size()];
    for (const bool is_flipped : {false, true}) {
      const Eigen::VectorXd joints = is_flipped ? FlippedPosture(nominal, sent) : sent;
      const StatedPose command = cell->Stated(joints);
      const Eigen::Vector3d gripper_off_m =
          Correct(cell->solution, command).base_from_mount.translation - cell->TruePose(joints).translation;
      agreements[is_flipped ? "reached in another configuration" : "reached"].Add(
          gripper_off_m - off_m(located, near),
          CovarianceOfReach(setup, cell->solution, located, command, Eigen::Vector3d::Zero(), middle), dof);
    }
  }
  return agreements;
}

// If all standard deviations are known, squares of errors are chi-square with 3 degrees of freedom, whose variance is
// 6: their mean is within 4 sigmas of 3.
void ExpectChiSquares(Setup setup, int num_trials) {
  const std::map<std::string, LocationAgreement> agreements = AgreementsOf(setup, Sigmas::kGiven, num_trials);
  for (const auto& [name, agreement] : agreements) {
    EXPECT_NEAR(agreement.chi_square_sum / num_trials, 3, 4 * std::sqrt(6.0 / num_trials)) << name;
  }
  EXPECT_GT(agreements.at("reached in another configuration").by_calibration_m2,
            2 * agreements.at("reached").by_calibration_m2);
}

// Estimated standard deviations are themselves uncertain: a region is one of Fisher's F with
// PairSolution::covariance_dof. The share outside of it is within 4 sigmas of a binomial distribution; `outside` is
// large enough that none outside is not.
void ExpectRegionsHold(Setup setup, int num_trials, double outside) {
  const double tolerance = 4 * std::sqrt(outside * (1 - outside) * num_trials);
  ASSERT_GT(outside * num_trials, tolerance);
  for (const auto& [name, agreement] : AgreementsOf(setup, Sigmas::kEstimated, num_trials)) {
    const auto num_outside = std::count_if(agreement.p_values.begin(), agreement.p_values.end(),
                                           [&](double p_value) { return p_value < outside; });
    EXPECT_NEAR(static_cast<double>(num_outside), outside * num_trials, tolerance) << name;
  }
}

constexpr int kEverydayTrials = 100;
constexpr int kNightlyTrials = 400;

class ArmLocationTest : public testing::TestWithParam<Setup> {};
INSTANTIATE_TEST_SUITE_P(, ArmLocationTest, testing::Values(Setup::kEyeToHand, Setup::kEyeInHand),
                         [](const auto& test) { return std::string(SetupName(test.param)); });

TEST_P(ArmLocationTest, ErrorsAreChiSquareIfTheSigmasAreKnown) { ExpectChiSquares(GetParam(), kEverydayTrials); }

TEST(ArmLocationNightly, ErrorsAreChiSquareIfTheSigmasAreKnown) {
  for (const heba::Setup setup : {heba::Setup::kEyeToHand, heba::Setup::kEyeInHand}) {
    SCOPED_TRACE(SetupName(setup));
    ExpectChiSquares(setup, kNightlyTrials);
  }
}

TEST_P(ArmLocationTest, ConfidenceRegionsHoldTheTruthIfTheSigmasAreEstimated) {
  ExpectRegionsHold(GetParam(), kEverydayTrials, 0.2);
}

TEST(ArmLocationNightly, ConfidenceRegionsHoldTheTruthIfTheSigmasAreEstimated) {
  for (const heba::Setup setup : {heba::Setup::kEyeToHand, heba::Setup::kEyeInHand}) {
    SCOPED_TRACE(SetupName(setup));
    ExpectRegionsHold(setup, kNightlyTrials, 0.05);
  }
}

// The derivatives by the arm's errors are those of differences: the rounding of a step of 1e-6 is 1e-9.
TEST_P(ArmLocationTest, DerivativesByTheArmAreThoseOfDifferences) {
  std::optional<Cell> cell = Calibrated(GetParam(), Sigmas::kEstimated, 3);
  ASSERT_TRUE(cell.has_value());
  const Sight sight = SightAt(cell->arm.joints[3], &*cell);
  const PairSolution& solution = cell->solution;
  const Eigen::Index first = solution.covariance.layout.Block(kRobotBlock).first;
  const auto locate = [&](const PairSolution& with) {
    return LocateTarget(GetParam(), with, sight.seen, sight.camera_mount)->world_from_target.translation;
  };
  const Outcome<LocatedTarget> located = LocateTarget(GetParam(), solution, sight.seen, sight.camera_mount);
  ASSERT_TRUE(located.ok()) << located.reason();
  const Eigen::Vector3d origin = located->world_from_target.translation;
  const StatedPose command = cell->Stated(cell->arm.joints[5]);
  const CorrectedPose corrected = Correct(solution, command);
  constexpr double kStep = 1e-6;
  for (Eigen::Index i = 0; i < solution.effects.size(); ++i) {
    PairSolution moved = solution;
    moved.effects[i] += kStep;
    const Eigen::Vector3d target = PointByMotion(origin) * located->uncertainty.by_unknowns.col(first + i);
    EXPECT_LT(((locate(moved) - origin) / kStep - target).norm(), 1e-4);
    const Tangent6 tangent =
        LocalCoordinates(corrected.base_from_mount, Correct(moved, command).base_from_mount) / kStep;
    EXPECT_LT((tangent - corrected.by_unknowns.col(first + i)).norm(), 1e-4);
  }
}

}  // namespace
}  // namespace heba
