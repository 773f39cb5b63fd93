// Tests of the calibration from poses of the target, with the errors of an arm.
#include <memory>

#include <gtest/gtest.h>

#include "heba/pair_cross_validation.h"
#include "solvers/calibration/model_choice.h"
#include "tests/support/arm_scenes.h"

namespace heba {
namespace {

constexpr Setup kSetup = Setup::kEyeToHand;

// The pairs of an arm's captures, with errors of the poses that the camera sees of 0.1 mm and 0.1 mrad.
std::vector<PosePair> PairsOf(const ArmScene& arm, uint64_t seed) {
  Rng rng(seed);
  const Arm actual = WithChanges(arm.nominal, arm.errors);
  std::vector<PosePair> pairs;
  for (const View& view : arm.scene.views) {
    PosePair pair;
    pair.camera_mount_from_target_mount = view.camera_mount_from_target_mount;
    pair.effect = view.effect;
    Tangent6 noise;
    noise << 1e-4 * rng.NormalVector3(), 1e-4 * rng.NormalVector3();
    const Rigid3d true_mount =
        CorrectedMount(kSetup, view.camera_mount_from_target_mount, view.effect->Evaluate(arm.errors, nullptr));
    pair.camera_from_target = Retract(CameraFromTarget(arm.scene.hand_eye, true_mount), noise);
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

PoseCalibrationOptions OptionsOf(const ArmScene& arm) {
  PoseCalibrationOptions options;
  options.setup = kSetup;
  options.has_robot_noise = true;
  for (const ArmErrorModel model : {ArmErrorModel::kOffsets, ArmErrorModel::kGeometry}) {
    options.effects.push_back(std::make_shared<const SharedEffects>(ArmErrors(arm.nominal, model)));
  }
  return options;
}

const HoldOut& HoldOutOf(const std::vector<HoldOut>& all, const std::string& method) {
  const auto found = std::find_if(all.begin(), all.end(), [&](const HoldOut& entry) { return entry.method == method; });
  CHECK(found != all.end()) << method;
  return *found;
}

TEST(PoseCalibrationTest, ErrorsOfTheArmAreEstimatedAndPredictHeldOutPoses) {
  ArmSceneOptions scene;
  scene.num_captures = 40;
  scene.joint_noise_rad = 0;
  const ArmScene arm = MakeArmScene(1, scene);
  const PoseCalibrationOptions options = OptionsOf(arm);
  PoseCalibrationOptions plain;
  plain.setup = kSetup;
  const PairCalibration with_arm = CalibratePoses(PairsOf(arm, 2), options);
  const PairCalibration without = CalibratePoses(PairsOf(arm, 2), plain);
  ASSERT_TRUE(with_arm.chain.ok()) << with_arm.chain.reason();
  ASSERT_TRUE(without.chain.ok()) << without.chain.reason();
  ASSERT_NE(with_arm.bundle.effects, nullptr);
  EXPECT_EQ(with_arm.bundle.effects->name, options.effects.back()->name);
  ASSERT_EQ(with_arm.alternatives.size(), 3U);
  // The likelihood ratio rejects the offsets alone, so that their odds decide nothing.
  EXPECT_LT(*with_arm.alternatives[1].p, kModelRejected);
  EXPECT_FALSE(with_arm.alternatives[1].odds.has_value());
  const double held_out_m = *HoldOutOf(CrossValidatePoses(with_arm, options, 5), kChainMethod).target_m;
  EXPECT_LT(held_out_m, 0.5 * *HoldOutOf(CrossValidatePoses(without, plain, 5), kChainMethod).target_m);
  // The poses of the target themselves have errors of sqrt(3) x 0.1 mm.
  EXPECT_GT(held_out_m, 0.1e-3);
  EXPECT_LT(held_out_m, 0.6e-3);
}

TEST(PoseCalibrationTest, ExactArmIsNotEstimated) {
  ArmSceneOptions scene;
  scene.offset_rad = scene.length_m = scene.angle_rad = scene.joint_noise_rad = 0;
  scene.num_captures = 30;
  int num_declined = 0;
  constexpr int kTrials = 10;
  for (int trial = 0; trial < kTrials; ++trial) {
    const ArmScene arm = MakeArmScene(20 + static_cast<uint64_t>(trial), scene);
    const PairCalibration calibration = CalibratePoses(PairsOf(arm, 3 + static_cast<uint64_t>(trial)), OptionsOf(arm));
    ASSERT_TRUE(calibration.chain.ok()) << calibration.chain.reason();
    num_declined += calibration.bundle.effects == nullptr ? 1 : 0;
  }
  EXPECT_GE(num_declined, kTrials - 1);
}

// A fold whose calibration fails gives the reason and no figure.
TEST(PoseCalibrationTest, FoldWithoutEnoughPosesFails) {
  ArmSceneOptions scene;
  scene.num_captures = 3;
  const ArmScene arm = MakeArmScene(4, scene);
  PoseCalibrationOptions plain;
  plain.setup = kSetup;
  const PairCalibration calibration = CalibratePoses(PairsOf(arm, 5), plain);
  const HoldOut chain = HoldOutOf(CrossValidatePoses(calibration, plain, 3), kChainMethod);
  EXPECT_FALSE(chain.target_m.has_value());
  EXPECT_EQ(chain.reason.ToString().find("of_fold (fold 1): "), 0U) << chain.reason.ToString();
}

}  // namespace
}  // namespace heba
