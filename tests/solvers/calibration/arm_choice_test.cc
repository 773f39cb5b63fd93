// Tests of the decision whether the errors of an arm are estimated.
#include <memory>

#include <gtest/gtest.h>

#include "solvers/calibration/model_choice.h"
#include "tests/support/arm_scenes.h"

namespace heba {
namespace {

AutoModel ChooseFrom(const Arm& arm) {
  AutoModel choose{true, false};
  for (const ArmErrorModel model : {ArmErrorModel::kOffsets, ArmErrorModel::kGeometry}) {
    choose.effects.push_back(std::make_shared<const SharedEffects>(ArmErrors(arm, model)));
  }
  return choose;
}

Outcome<ModelChoice> Choose(const ArmScene& arm, Setup setup = Setup::kEyeToHand) {
  BundleOptions options;
  options.loss = LossKind::kNone;
  return ChooseModel({arm.scene.camera, arm.scene.views, setup}, arm.scene.hand_eye, options, ChooseFrom(arm.nominal));
}

// Returns the name of the chosen errors; "none" without.
std::string ChosenErrors(const Outcome<ModelChoice>& choice) {
  if (!choice) return choice.reason();
  return choice->options.effects == nullptr ? "none" : choice->options.effects->name;
}

struct ChoiceCase {
  std::string name;
  ArmSceneOptions options;
  std::string errors;
};
void PrintTo(const ChoiceCase& choice, std::ostream* stream) { *stream << choice.name; }

class ArmModelTest : public testing::TestWithParam<ChoiceCase> {};
INSTANTIATE_TEST_SUITE_P(
    , ArmModelTest,
    testing::Values(
        ChoiceCase{"exact_arm", {.offset_rad = 0, .length_m = 0, .angle_rad = 0, .joint_noise_rad = 0}, "none"},
        ChoiceCase{"noisy_joints", {.offset_rad = 0, .length_m = 0, .angle_rad = 0}, "none"},
        ChoiceCase{"offsets", {.offset_rad = DegToRad(0.1), .length_m = 0, .angle_rad = 0}, "joint offsets"},
        ChoiceCase{"geometry", {}, "joint offsets and geometry"},
        // So few captures do not reject offsets alone, but do not show that the other errors are small either.
        ChoiceCase{"geometry_of_few_captures",
                   {.num_captures = 8,
                    .has_several_configurations = false,
                    .length_m = 0.2e-3,
                    .angle_rad = DegToRad(0.02),
                    .joint_noise_rad = DegToRad(0.006)},
                   "joint offsets and geometry"}),
    [](const auto& test) { return test.param.name; });

// The right model is rejected with a probability of some 1 %: three or more rejections in 20 seeds occur once in 1,000
// runs.
TEST_P(ArmModelTest, FindsTheErrorsOfTheArm) {
  constexpr int kTrials = 20;
  int num_right = 0;
  std::string wrong;
  for (int trial = 0; trial < kTrials; ++trial) {
    const std::string chosen =
        ChosenErrors(Choose(MakeArmScene(300 + static_cast<uint64_t>(trial), GetParam().options)));
    num_right += chosen == GetParam().errors ? 1 : 0;
    if (chosen != GetParam().errors) wrong += chosen + "; ";
  }
  EXPECT_GE(num_right, kTrials - 2) << wrong;
}

// An offset of the first joint or of the last one is part of the poses of camera and board: no error is found, and the
// hand-eye pose absorbs it.
TEST(ArmChoiceTest, ErrorsThatAPoseAbsorbsAreNotFound) {
  for (const int joint : {0, 5}) {
    ArmSceneOptions options;
    options.offset_rad = options.length_m = options.angle_rad = options.joint_noise_rad = 0;
    options.changes = {{ArmParamPlace(joint, ArmParam::kTheta), DegToRad(0.5)}};
    const ArmScene arm = MakeArmScene(7, options);
    const Outcome<ModelChoice> choice = Choose(arm);
    EXPECT_EQ(ChosenErrors(choice), "none") << joint;
    EXPECT_EQ(choice->options.robot, BundleOptions::Robot::kExact) << joint;
  }
}

TEST(ArmChoiceTest, FewCapturesDecline) {
  ArmSceneOptions options;
  options.num_captures = 7;
  EXPECT_EQ(ChosenErrors(Choose(MakeArmScene(8, options))), "none");
}

}  // namespace
}  // namespace heba
