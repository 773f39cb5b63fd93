// Tests of the choice of smooth errors of a robot whose arm is not known.
#include <algorithm>
#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "heba/base/factorisation.h"
#include "heba/bundle_adjustment.h"
#include "heba/evaluation/metrics.h"
#include "solvers/calibration/smooth_search.h"
#include "solvers/refine/hand_eye_problem.h"
#include "tests/support/arm_scenes.h"

namespace heba {
namespace {

constexpr Setup kSetup = Setup::kEyeToHand;

// The captures of an arm with errors, as those of a robot without a known arm.
PairProblem ProblemOf(const ArmScene& arm) {
  PairProblem problem{arm.scene.camera, arm.scene.views, kSetup};
  for (View& view : problem.views) {
    view.effect = nullptr;
    view.gripper_by_joints.resize(6, 0);
  }
  return problem;
}

BundleOptions White() {
  BundleOptions options;
  options.loss = LossKind::kNone;
  options.robot = BundleOptions::Robot::kEstimatedNoise;
  return options;
}

struct SmoothFit {
  PairProblem problem;
  std::shared_ptr<const SharedEffects> effects;
  bool is_likely = false;
};

// Returns the problem with the most likely smooth errors as the effects of its views.
SmoothFit WithSmoothErrors(const ArmScene& arm) {
  SmoothFit fit{ProblemOf(arm), nullptr};
  const Outcome<PairSolution> white = RefineHandEye(fit.problem, arm.scene.hand_eye, White());
  CHECK(white.ok()) << white.reason();
  const std::vector<SmoothErrorsOfArm> of_arms =
      FindSmoothErrorsOfArms(HandEyeProblem(fit.problem, White()), ProblemSolution(*white));
  CHECK_EQ(of_arms.size(), 1U);
  const FoundSmoothErrors& found = of_arms.front().found;
  fit.effects = std::make_shared<const SharedEffects>(found.errors.effects());
  fit.is_likely = AreLikely(found);
  for (View& view : fit.problem.views) {
    view.effect = found.errors.EffectAt(BaseFromGripper(kSetup, view.camera_mount_from_target_mount));
  }
  return fit;
}

// Returns the solution with the smooth errors, or with white noise alone.
PairSolution SolutionOf(const SmoothFit& fit, const HandEye& start, bool is_smooth) {
  BundleOptions options = White();
  if (is_smooth) options.effects = fit.effects;
  const Outcome<PairSolution> solution = RefineHandEye(fit.problem, start, options);
  CHECK(solution.ok()) << solution.reason();
  return *solution;
}

// The errors of an arm in one configuration are smooth functions of the pose.
TEST(SmoothChoiceTest, ErrorsOfAnArmAreFoundToBeSmooth) {
  ArmSceneOptions options;
  options.has_several_configurations = false;
  options.joint_noise_rad = 0;
  constexpr int kTrials = 5;
  int num_chosen = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    num_chosen += WithSmoothErrors(MakeArmScene(700 + static_cast<uint64_t>(trial), options)).is_likely ? 1 : 0;
  }
  EXPECT_EQ(num_chosen, kTrials);
}

// Noise that each capture draws anew is not smooth. A few captures do not exclude that half of it is, and then the RMS
// error grows, by at most three tenths, and the covariance still holds: the mean chi-square with 6 degrees of freedom
// is within 4 standard deviations (of 1) of 6.
TEST(SmoothChoiceNightly, WhiteNoiseThatIsTakenForSmoothCostsLittle) {
  ArmSceneOptions options;
  options.offset_rad = options.length_m = options.angle_rad = 0;
  options.joint_noise_rad = DegToRad(0.02);
  options.has_several_configurations = false;
  constexpr int kTrials = 12;
  double squares = 0;
  double squares_of_white = 0;
  double chi2 = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const ArmScene arm = MakeArmScene(800 + static_cast<uint64_t>(trial), options);
    const SmoothFit fit = WithSmoothErrors(arm);
    const PairSolution chosen = SolutionOf(fit, arm.scene.hand_eye, fit.is_likely);
    const Rigid3d& truth = arm.scene.hand_eye.camera_mount_from_camera;
    const auto error_of = [&](const PairSolution& solution) {
      return LocalCoordinates(truth, solution.hand_eye.camera_mount_from_camera);
    };
    const Tangent6 error = error_of(chosen);
    squares += error.head<3>().squaredNorm();
    squares_of_white += error_of(SolutionOf(fit, arm.scene.hand_eye, false)).head<3>().squaredNorm();
    chi2 += MahalanobisSquare(error, *PoseCovarianceOf(chosen.covariance, kHandEyeBlock)) / kTrials;
  }
  EXPECT_LT(squares, 1.3 * 1.3 * squares_of_white);
  EXPECT_NEAR(chi2, 6, 4);
}

// Beside smooth errors, the variances of white noise are often most likely to be zero although no few captures can show
// that they are. The estimate then keeps them from zero, because poses would count as known up to their smooth errors.
TEST(SmoothChoiceTest, WhiteNoiseBesideSmoothErrorsIsNotTakenForZero) {
  ArmSceneOptions options;
  options.has_several_configurations = false;
  options.joint_noise_rad = 0;
  options.num_captures = 12;
  constexpr int kTrials = 6;
  constexpr double kZero = 1e-7;  // m or rad
  int num_most_likely_zero = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const ArmScene arm = MakeArmScene(900 + static_cast<uint64_t>(trial), options);
    const SmoothFit fit = WithSmoothErrors(arm);
    BundleOptions most_likely = White();
    most_likely.effects = fit.effects;
    most_likely.effects_avoid_zero = false;
    const Outcome<PairSolution> solution = RefineHandEye(fit.problem, arm.scene.hand_eye, most_likely);
    ASSERT_TRUE(solution.ok()) << solution.reason();
    const auto smallest = [](const RobotNoise& noise) { return std::min(noise.translation_m, noise.rotation_rad); };
    num_most_likely_zero += smallest(*solution->robot_noise) < kZero ? 1 : 0;
    EXPECT_GT(smallest(*SolutionOf(fit, arm.scene.hand_eye, true).robot_noise), 100 * kZero);
  }
  EXPECT_GE(num_most_likely_zero, 2);
}

// Many captures of a robot whose noise is white show that it is, and white noise alone remains.
TEST(SmoothChoiceNightly, ManyCapturesShowThatNoiseIsWhite) {
  ArmSceneOptions options;
  options.offset_rad = options.length_m = options.angle_rad = 0;
  options.joint_noise_rad = DegToRad(0.02);
  options.has_several_configurations = false;
  options.num_captures = 120;
  constexpr int kTrials = 4;
  int num_chosen = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    num_chosen += WithSmoothErrors(MakeArmScene(850 + static_cast<uint64_t>(trial), options)).is_likely ? 1 : 0;
  }
  EXPECT_LE(num_chosen, 1);
}

// Captures that the estimate has not seen are predicted better than with white noise.
TEST(SmoothChoiceTest, HeldOutCapturesArePredictedBetter) {
  ArmSceneOptions options;
  options.has_several_configurations = false;
  options.joint_noise_rad = 0;
  options.num_captures = 40;
  const ArmScene arm = MakeArmScene(900, options);
  const SmoothFit fit = WithSmoothErrors(arm);
  PairProblem training = fit.problem;
  training.views.resize(25);
  const std::vector<View> held_out(fit.problem.views.begin() + 25, fit.problem.views.end());
  BundleOptions smooth = White();
  smooth.effects = fit.effects;
  const auto rms_px = [&](const BundleOptions& refine) {
    const Outcome<PairSolution> solution = RefineHandEye(training, arm.scene.hand_eye, refine);
    CHECK(solution.ok()) << solution.reason();
    return *ReprojectionErrors(solution->hand_eye, solution->camera, CorrectedViews(kSetup, held_out, *solution))
                ->RmsPx();
  };
  EXPECT_LT(rms_px(smooth), 0.6 * rms_px(White()));
}

}  // namespace
}  // namespace heba
