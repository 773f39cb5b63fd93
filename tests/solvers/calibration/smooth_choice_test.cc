// Tests of the choice of smooth errors of a robot whose arm is not known.
#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "heba/evaluation/metrics.h"
#include "solvers/calibration/model_choice.h"
#include "tests/support/arm_scenes.h"

namespace heba {
namespace {

constexpr Setup kSetup = Setup::kEyeToHand;

// The captures of an arm with errors, as those of a robot without a known arm.
Problem ProblemOf(const ArmScene& arm) {
  Problem problem{arm.scene.camera, arm.scene.views, kSetup};
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
  Problem problem;
  std::shared_ptr<const SharedEffects> effects;
};

// Returns the problem with the most likely smooth errors as the effects of its views.
SmoothFit WithSmoothErrors(const ArmScene& arm) {
  SmoothFit fit{ProblemOf(arm), nullptr};
  const Outcome<Solution> white = RefineHandEye(fit.problem, arm.scene.hand_eye, White());
  CHECK(white.ok()) << white.reason();
  const std::optional<SmoothErrors> errors = MostLikelySmoothErrors(fit.problem, *white, White());
  CHECK(errors.has_value());
  fit.effects = std::make_shared<const SharedEffects>(errors->effects());
  for (View& view : fit.problem.views) {
    view.effect = errors->EffectAt(BaseFromGripper(kSetup, view.camera_mount_from_target_mount));
  }
  return fit;
}

bool ChoosesSmoothErrors(const ArmScene& arm) {
  const SmoothFit fit = WithSmoothErrors(arm);
  BundleOptions options;
  options.loss = LossKind::kNone;
  const Outcome<ModelChoice> choice =
      ChooseModel(fit.problem, arm.scene.hand_eye, options, {true, false, {fit.effects}});
  CHECK(choice.ok()) << choice.reason();
  return choice->options.effects != nullptr;
}

// The errors of an arm in one configuration are smooth functions of the pose.
TEST(SmoothChoiceTest, ErrorsOfAnArmAreFoundToBeSmooth) {
  ArmSceneOptions options;
  options.has_several_configurations = false;
  options.joint_noise_rad = 0;
  constexpr int kTrials = 5;
  int num_chosen = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    num_chosen += ChoosesSmoothErrors(MakeArmScene(700 + static_cast<uint64_t>(trial), options)) ? 1 : 0;
  }
  EXPECT_EQ(num_chosen, kTrials);
}

// Noise that each capture draws anew is not smooth. The choice is wrong with a probability of 1 %: two wrong ones of 20
// occur once in 60 runs.
TEST(SmoothChoiceTest, WhiteNoiseIsNotFoundToBeSmooth) {
  ArmSceneOptions options;
  options.offset_rad = options.length_m = options.angle_rad = 0;
  options.joint_noise_rad = DegToRad(0.02);
  options.has_several_configurations = false;
  constexpr int kTrials = 20;
  int num_chosen = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    num_chosen += ChoosesSmoothErrors(MakeArmScene(800 + static_cast<uint64_t>(trial), options)) ? 1 : 0;
  }
  EXPECT_LE(num_chosen, 2);
}

// Captures that the estimate has not seen are predicted better than with white noise.
TEST(SmoothChoiceTest, HeldOutCapturesArePredictedBetter) {
  ArmSceneOptions options;
  options.has_several_configurations = false;
  options.joint_noise_rad = 0;
  options.num_captures = 40;
  const ArmScene arm = MakeArmScene(900, options);
  const SmoothFit fit = WithSmoothErrors(arm);
  Problem training = fit.problem;
  training.views.resize(25);
  const std::vector<View> held_out(fit.problem.views.begin() + 25, fit.problem.views.end());
  BundleOptions smooth = White();
  smooth.effects = fit.effects;
  const auto rms_px = [&](const BundleOptions& refine) {
    const Outcome<Solution> solution = RefineHandEye(training, arm.scene.hand_eye, refine);
    CHECK(solution.ok()) << solution.reason();
    return *ReprojectionErrors(solution->hand_eye, solution->camera, CorrectedViews(kSetup, held_out, *solution))
                ->RmsPx();
  };
  EXPECT_LT(rms_px(smooth), 0.6 * rms_px(White()));
}

}  // namespace
}  // namespace heba
