// Tests of runs whose captures are in several configurations of an arm: heba/run.h.
#include <algorithm>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/run.h"
#include "tests/support/datasets.h"

namespace heba {
namespace {
using ::testing::Contains;
using ::testing::IsEmpty;

// Errors three times those of usual arms make a configuration that was never seen look wrong.
ArmSceneOptions LargeErrors() {
  ArmSceneOptions options;
  options.setup = Setup::kEyeInHand;
  options.offset_rad *= 3;
  options.length_m *= 3;
  options.angle_rad *= 3;
  return options;
}

TEST(ArmClustersTest, FewCapturesInAThirdConfigurationAreNotLeftOut) {
  for (const uint64_t seed : {1, 2, 3}) {
    const ArmDataset made = ThreeConfigurations(seed, LargeErrors(), 40, 4);
    const Outcome<RunOutput> run = heba::Run(WithFixedCamera(made.dataset), RunOptions());
    ASSERT_TRUE(run) << run.reason();
    EXPECT_THAT(LeftOutOf(run->result), IsEmpty()) << "seed " << seed;
    EXPECT_TRUE(run->result.arms[0]->is_estimated) << run->result.arms[0]->reason.ToString();
    // The folds keep them, too: the error of held-out captures is that of the noise.
    EXPECT_LT(*FindRefined(run->result)->errors.holdout_target_mm, 0.5) << "seed " << seed;
  }
}

TEST(ArmClustersNightly, WrongPosesInOneConfigurationAreLeftOut) {
  ArmSceneOptions options;
  options.setup = Setup::kEyeInHand;
  ArmDataset made = ThreeConfigurations(4, options, 60, 20);
  Rng rng(5);
  std::vector<std::string> wrong;
  for (size_t i = made.dataset.captures.size() - 20; i < made.dataset.captures.size(); i += 2) {
    Rigid3d& pose = made.dataset.captures[i].base_from_gripper[0];
    pose = pose * Rigid3d{ExpRotation(0.05 * rng.Direction3()), 0.03 * rng.Direction3()};
    wrong.push_back(made.dataset.captures[i].name);
  }
  // The poses are wrong, so that the joints do not belong to them.
  made.dataset.arms.clear();
  const Outcome<RunOutput> run = heba::Run(WithFixedCamera(made.dataset), WithoutFolds());
  ASSERT_TRUE(run) << run.reason();
  const std::vector<std::string> left_out = LeftOutOf(run->result);
  for (const std::string& name : wrong) EXPECT_THAT(left_out, Contains(name));
  // A few right captures may look wrong, too, in a configuration of which half are.
  EXPECT_LE(left_out.size(), wrong.size() + 2);
}

TEST(ArmClustersTest, ConfigurationOfEachCaptureIsFoundFromItsPose) {
  ArmDataset made = ThreeConfigurations(6, LargeErrors(), 40, 6);
  for (Recording& capture : made.dataset.captures) capture.joints.clear();
  const Outcome<RunOutput> run = heba::Run(WithFixedCamera(made.dataset), RunOptions());
  ASSERT_TRUE(run) << run.reason();
  const RobotSummary& robot = *run->result.arms[0];
  ASSERT_TRUE(robot.is_estimated) << robot.reason.ToString();
  EXPECT_EQ(robot.configuration, "");
  // Errors in the wrong configuration would leave most of the noise.
  EXPECT_LT(robot.noise_after->translation_m, 0.3 * robot.noise_before->translation_m);
  // Captures whose posture is not the right one are left out.
  EXPECT_LE(LeftOutOf(run->result).size(), made.dataset.captures.size() / 5);
}

TEST(ArmClustersTest, ConfigurationOfEachCaptureIsFoundWithoutImages) {
  ArmDataset made = ThreeConfigurations(6, LargeErrors(), 40, 6);
  Rng rng(7);
  for (Rigid3d& pose : made.camera_from_target) {
    pose = pose * Rigid3d{ExpRotation(1e-4 * rng.Direction3()), 5e-5 * rng.Direction3()};
  }
  made.dataset.target_poses = made.camera_from_target;
  made.dataset.given_detections.clear();
  const Outcome<RunOutput> with_joints = heba::Run(made.dataset, WithoutFolds());
  ASSERT_TRUE(with_joints) << with_joints.reason();
  for (Recording& capture : made.dataset.captures) capture.joints.clear();
  const Outcome<RunOutput> run = heba::Run(made.dataset, WithoutFolds());
  ASSERT_TRUE(run) << run.reason();
  const RobotSummary& robot = *run->result.arms[0];
  ASSERT_TRUE(robot.is_estimated) << robot.reason.ToString();
  EXPECT_LT(robot.noise_after->translation_m, 1.3 * with_joints->result.arms[0]->noise_after->translation_m);
}

// Noise must not look like a change of the configuration.
TEST(ArmClustersTest, PosesInOneConfigurationAreNotReadInSeveral) {
  for (const uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    ArmSceneOptions options;
    options.setup = Setup::kEyeInHand;
    options.has_several_configurations = false;
    options.num_captures = 40;
    const ArmScene scene = MakeArmScene(seed, options);
    Dataset dataset =
        DatasetOf(scene.scene, options.setup, ParseTarget("{type: chessboard, rows: 6, columns: 8, square: 30 mm}"));
    dataset.given_detections.clear();
    dataset.arms = {RobotArm{scene.nominal, scene.tip_from_gripper, {}}};
    Rng rng(seed);
    for (const PosePair& pair : scene.scene.pairs) {
      const Eigen::Vector3d rotation_rad{6e-4 * rng.Normal(), 6e-4 * rng.Normal(), 6e-4 * rng.Normal()};
      const Eigen::Vector3d translation_m{3e-4 * rng.Normal(), 3e-4 * rng.Normal(), 3e-4 * rng.Normal()};
      dataset.target_poses.push_back(pair.camera_from_target * Rigid3d(ExpRotation(rotation_rad), translation_m));
    }
    const Outcome<RunOutput> run = heba::Run(dataset, WithoutFolds());
    ASSERT_TRUE(run) << run.reason();
    EXPECT_NE(run->result.arms[0]->configuration, "") << "seed " << seed << ": several";
  }
}

TEST(ArmClustersTest, CaptureWithWrongJointsIsLeftOutAndTheArmIsEstimated) {
  ArmDataset made = ThreeConfigurations(8, ArmSceneOptions(), 30, 10);
  made.dataset.captures[4].joints[0][2] = 1e9;
  const Outcome<RunOutput> run = heba::Run(WithFixedCamera(made.dataset), WithoutFolds());
  ASSERT_TRUE(run) << run.reason();
  EXPECT_TRUE(run->result.arms[0]->is_estimated) << run->result.arms[0]->reason.ToString();
  EXPECT_THAT(LeftOutOf(run->result), testing::ElementsAre(made.dataset.captures[4].name));
  EXPECT_THAT(run->result.images[4].reason, testing::HasSubstr("its joints or its pose are wrong"));
}

}  // namespace
}  // namespace heba
