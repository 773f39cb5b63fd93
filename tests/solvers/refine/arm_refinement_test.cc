#include <algorithm>
#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/bundle_adjustment.h"
#include "heba/refinement.h"
#include "solvers/refine/hand_eye_problem.h"
#include "tests/support/arm_scenes.h"

namespace heba {
namespace {

Outcome<PairSolution> Refine(const ArmScene& arm, Setup setup, std::shared_ptr<const SharedEffects> effects) {
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.robot = BundleOptions::Robot::kEstimatedNoise;
  options.effects = std::move(effects);
  return RefineHandEye({arm.scene.camera, arm.scene.views, setup}, arm.scene.hand_eye, options);
}

double HandEyeErrorM(const ArmScene& arm, const PairSolution& solution) {
  return DistanceM(arm.scene.hand_eye.camera_mount_from_camera, solution.hand_eye.camera_mount_from_camera);
}

struct Case {
  std::string arm;
  Setup setup;
  bool has_several_configurations;
};

class ArmRefinementTest : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(, ArmRefinementTest,
                         testing::Values(Case{"ur5e", Setup::kEyeToHand, true}, Case{"ur5e", Setup::kEyeInHand, true},
                                         Case{"ur5e", Setup::kEyeToHand, false},
                                         Case{"franka_fr3", Setup::kEyeInHand, true},
                                         Case{"kuka_kr6_r900", Setup::kEyeToHand, true}),
                         [](const auto& test) {
                           return test.param.arm + (test.param.setup == Setup::kEyeToHand ? "_to_hand" : "_in_hand") +
                                  (test.param.has_several_configurations ? "" : "_one_configuration");
                         });

// The errors of all unknowns, whitened by the covariance of the estimate, are those of the simulated noise.
TEST_P(ArmRefinementTest, ErrorsOfTheArmAreFoundWithHonestCovariance) {
  ArmSceneOptions options;
  options.arm = GetParam().arm;
  options.setup = GetParam().setup;
  options.has_several_configurations = GetParam().has_several_configurations;
  options.num_captures = 25;
  constexpr int kTrials = 16;
  double sum_squares = 0;
  double dof = 0;
  double white_m2 = 0;
  double arm_m2 = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const ArmScene arm = MakeArmScene(100 + static_cast<uint64_t>(trial), options);
    const auto effects = std::make_shared<const SharedEffects>(ArmErrors(arm.nominal, ArmErrorModel::kGeometry));
    const Outcome<PairSolution> white = Refine(arm, options.setup, nullptr);
    const Outcome<PairSolution> found = Refine(arm, options.setup, effects);
    ASSERT_TRUE(white.ok()) << white.reason();
    ASSERT_TRUE(found.ok()) << found.reason();
    Eigen::VectorXd error(found->covariance.matrix.rows());
    const UnknownLayout& layout = found->covariance.layout;
    error.segment<6>(layout.Block(kHandEyeBlock).first) =
        LocalCoordinates(arm.scene.hand_eye.camera_mount_from_camera, found->hand_eye.camera_mount_from_camera);
    error.segment<6>(layout.Block(kBoardBlock).first) =
        LocalCoordinates(arm.scene.hand_eye.target_mount_from_target, found->hand_eye.target_mount_from_target);
    const UnknownBlock robot = layout.Block(kRobotBlock);
    for (size_t i = 0; i < effects->effects.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      error[robot.first + k] = found->effects[k] - arm.errors[effects->effects[i].index];
    }
    const UnknownBlock camera = layout.Block(kCameraBlock);
    for (Eigen::Index i = camera.first; i < camera.end(); ++i) {
      const auto param = static_cast<size_t>(layout[i].index);
      error[i] = found->camera.params[param] - arm.scene.camera.params[param];
    }
    const Eigen::VectorXd scale = found->covariance.matrix.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = scale.asDiagonal() * found->covariance.matrix * scale.asDiagonal();
    const Eigen::VectorXd whitened = scale.cwiseProduct(error);
    sum_squares += MahalanobisSquare(whitened, scaled);
    dof += static_cast<double>(error.size());
    white_m2 += std::pow(HandEyeErrorM(arm, *white), 2);
    arm_m2 += std::pow(HandEyeErrorM(arm, *found), 2);
  }
  // Averaged over the trials, the hand-eye pose is better by this factor than with white noise.
  EXPECT_LT(std::sqrt(arm_m2 / white_m2), 0.5);
  EXPECT_GT(ChiSquareTail(sum_squares, dof), 1e-4) << sum_squares / dof;
}

// Without systematic errors, the noise of the joints is found as such, and leaves nothing to the white noise of the
// poses.
TEST(JointNoiseTest, NoiseOfTheJointsIsToldFromThatOfThePoses) {
  ArmSceneOptions options;
  options.offset_rad = options.length_m = options.angle_rad = 0;
  options.joint_noise_rad = DegToRad(0.02);
  options.num_captures = 40;
  double sum_joint_rad = 0;
  double sum_rotation_rad = 0;
  double sum_gain = 0;
  constexpr int kTrials = 8;
  for (int trial = 0; trial < kTrials; ++trial) {
    ArmScene arm = MakeArmScene(500 + static_cast<uint64_t>(trial), options);
    BundleOptions refine;
    refine.loss = LossKind::kNone;
    refine.robot = BundleOptions::Robot::kEstimatedNoise;
    const PairProblem problem{arm.scene.camera, arm.scene.views, options.setup};
    const Outcome<PairSolution> with_joints = RefineHandEye(problem, arm.scene.hand_eye, refine);
    ASSERT_TRUE(with_joints.ok()) << with_joints.reason();
    PairProblem white = problem;
    for (View& view : white.views) view.gripper_by_joints.resize(6, 0);
    const Outcome<PairSolution> without = RefineHandEye(white, arm.scene.hand_eye, refine);
    ASSERT_TRUE(without.ok()) << without.reason();
    sum_joint_rad += with_joints->robot_noise->joint_rad;
    sum_rotation_rad += with_joints->robot_noise->rotation_rad;
    EXPECT_EQ(without->robot_noise->joint_rad, 0);
    const auto log_likelihood_of = [&](const PairProblem& of_views, const PairSolution& solution) {
      return LogLikelihoodOf(HandEyeProblem(of_views, refine), ProblemSolution(solution), refine);
    };
    sum_gain += log_likelihood_of(problem, *with_joints) - log_likelihood_of(white, *without);
  }
  // 40 captures of six numbers determine the sigma to 5 % each.
  EXPECT_NEAR(RadToDeg(sum_joint_rad / kTrials), 0.02, 0.002);
  // A variance that is not there is found to be zero in half of the trials. Over 64 other seeds, the mean of eight
  // sigmas is 0.0026 deg with a standard deviation of 0.0012 deg.
  EXPECT_LT(RadToDeg(sum_rotation_rad / kTrials), 0.008);
  EXPECT_GT(sum_gain / kTrials, 3);
}

// The compliances are found within their sigmas, and the robot noise that remains without them is larger.
TEST(ArmGravityTest, CompliancesAreFoundWithinTheirSigmas) {
  ArmSceneOptions options;
  options.num_captures = 40;
  options.compliance_rad_per_nm = 4e-5;
  constexpr int kTrials = 4;
  double squares = 0;
  double sum_sigmas = 0;
  int num = 0;
  double gain = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const ArmScene arm = MakeArmScene(300 + static_cast<uint64_t>(trial), options);
    const auto geometry = std::make_shared<const SharedEffects>(ArmErrors(arm.nominal, ArmErrorModel::kGeometry));
    const auto gravity = std::make_shared<const SharedEffects>(ArmErrors(arm.nominal, ArmErrorModel::kGravity));
    const Outcome<PairSolution> without = Refine(arm, options.setup, geometry);
    const Outcome<PairSolution> with = Refine(arm, options.setup, gravity);
    ASSERT_TRUE(without.ok()) << without.reason();
    ASSERT_TRUE(with.ok()) << with.reason();
    const UnknownBlock robot = with->covariance.layout.Block(kRobotBlock);
    for (size_t i = 0; i < gravity->effects.size(); ++i) {
      if (gravity->groups[gravity->effects[i].group].name != "compliances") continue;
      const Eigen::Index k = robot.first + static_cast<Eigen::Index>(i);
      const double error = with->effects[static_cast<Eigen::Index>(i)] - arm.errors[gravity->effects[i].index];
      squares += error * error / with->covariance.matrix(k, k);
      ++num;
    }
    gain += without->robot_noise->rotation_rad / with->robot_noise->rotation_rad / kTrials;
    sum_sigmas += with->effect_sigmas[3];
  }
  EXPECT_EQ(num, 2 * kTrials);
  EXPECT_GT(ChiSquareTail(squares, num), 1e-4) << squares / num;
  // The joints yield by up to 0.2 deg, which the geometry cannot take in.
  EXPECT_GT(gain, 1.2);
  EXPECT_GT(sum_sigmas / kTrials, 1e-5);
}

}  // namespace
}  // namespace heba
