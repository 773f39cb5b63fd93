// Tests of runs whose captures are in several configurations of an arm: heba/run.h.
#include <algorithm>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/robot/arm_postures.h"
#include "heba/run.h"
#include "tests/support/arm_scenes.h"
#include "tests/support/datasets.h"

namespace heba {
namespace {
using ::testing::Contains;
using ::testing::IsEmpty;

// A data set of an arm, whose captures are sorted by configuration, as a path visits them.
struct ArmDataset {
  Dataset dataset;
  std::vector<std::string> configuration;   // One per capture.
  std::vector<Rigid3d> camera_from_target;  // Likewise, free of noise.
};

std::shared_ptr<const Target> Chessboard() {
  return ParseTarget("{type: chessboard, rows: 6, columns: 8, square: 30 mm}");
}

// `in_third`: number of captures in the configuration with the fewest, of `num_captures` in three.
ArmDataset ThreeConfigurations(uint64_t seed, ArmSceneOptions options, size_t num_captures, size_t in_third) {
  const std::shared_ptr<const Target> target = Chessboard();
  options.points = AllPoints(*target).points_in_target;
  options.num_captures = 150;
  options.tip_from_gripper = Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, 0.05});
  const ArmScene scene = MakeArmScene(seed, options);
  Dataset all = DatasetOf(scene.scene, options.setup, target);
  std::map<std::string, std::vector<size_t>> captures_in;
  for (size_t i = 0; i < scene.joints.size(); ++i) {
    all.captures[i].joints = {scene.joints[i].begin(), scene.joints[i].end()};
    captures_in[NameOf(*ConfigurationOf(scene.nominal, scene.joints[i]))].push_back(i);
  }
  std::vector<std::pair<size_t, std::string>> by_size;
  for (const auto& [name, captures] : captures_in) by_size.emplace_back(captures.size(), name);
  std::sort(by_size.rbegin(), by_size.rend());
  const size_t in_others = (num_captures - in_third) / 2;
  ArmDataset made;
  made.dataset = all;
  made.dataset.robot = RobotArm{scene.nominal, scene.tip_from_gripper, {}};
  made.dataset.captures.clear();
  made.dataset.given_detections.clear();
  for (size_t k = 0; k < 3; ++k) {
    const std::vector<size_t>& captures = captures_in[by_size[k].second];
    const size_t num = std::min(captures.size(), k < 2 ? in_others : in_third);
    for (size_t c = 0; c < num; ++c) {
      made.dataset.captures.push_back(all.captures[captures[c]]);
      made.dataset.given_detections.push_back(all.given_detections[captures[c]]);
      made.configuration.push_back(by_size[k].second);
      made.camera_from_target.push_back(scene.scene.pairs[captures[c]].camera_from_target);
    }
  }
  return made;
}

std::vector<std::string> LeftOutOf(const RunResult& result) {
  std::vector<std::string> names;
  for (const CaptureResult& capture : result.captures) {
    if (!capture.used) names.push_back(capture.image);
  }
  return names;
}

// Errors three times those of usual arms make a configuration that was never seen look wrong.
ArmSceneOptions LargeErrors() {
  ArmSceneOptions options;
  options.setup = Setup::kEyeInHand;
  options.offset_rad *= 3;
  options.length_m *= 3;
  options.angle_rad *= 3;
  return options;
}

RunOptions FixedCamera() {
  RunOptions options;
  options.bundle.free_intrinsics = {};
  return options;
}

TEST(ArmClustersTest, FewCapturesInAThirdConfigurationAreNotLeftOut) {
  for (const uint64_t seed : {1, 2, 3}) {
    const ArmDataset made = ThreeConfigurations(seed, LargeErrors(), 40, 4);
    const Outcome<RunOutput> run = heba::Run(made.dataset, FixedCamera());
    ASSERT_TRUE(run) << run.reason();
    EXPECT_THAT(LeftOutOf(run->result), IsEmpty()) << "seed " << seed;
    EXPECT_TRUE(run->result.robot->is_estimated) << run->result.robot->reason.ToString();
    // The folds keep them, too: the error of held-out captures is that of the noise.
    EXPECT_LT(*FindRefined(run->result)->errors.holdout_target_mm, 0.5) << "seed " << seed;
  }
}

TEST(ArmClustersTest, WrongPosesInOneConfigurationAreLeftOut) {
  ArmSceneOptions options;
  options.setup = Setup::kEyeInHand;
  ArmDataset made = ThreeConfigurations(4, options, 60, 20);
  Rng rng(5);
  std::vector<std::string> wrong;
  for (size_t i = made.dataset.captures.size() - 20; i < made.dataset.captures.size(); i += 2) {
    made.dataset.captures[i].base_from_gripper = made.dataset.captures[i].base_from_gripper *
                                                 Rigid3d(ExpRotation(0.05 * rng.Direction3()), 0.03 * rng.Direction3());
    wrong.push_back(made.dataset.captures[i].name);
  }
  // The poses are wrong, so that the joints do not belong to them.
  made.dataset.robot.reset();
  RunOptions run_options = FixedCamera();
  run_options.folds = 0;
  const Outcome<RunOutput> run = heba::Run(made.dataset, run_options);
  ASSERT_TRUE(run) << run.reason();
  const std::vector<std::string> left_out = LeftOutOf(run->result);
  for (const std::string& name : wrong) EXPECT_THAT(left_out, Contains(name));
  // A few right captures may look wrong, too, in a configuration of which half are.
  EXPECT_LE(left_out.size(), wrong.size() + 2);
}

TEST(ArmClustersTest, ConfigurationOfEachCaptureIsFoundFromItsPose) {
  ArmDataset made = ThreeConfigurations(6, LargeErrors(), 40, 6);
  std::vector<std::vector<double>> joints;
  for (Capture& capture : made.dataset.captures) joints.push_back(std::exchange(capture.joints, {}));
  const Outcome<RunOutput> run = heba::Run(made.dataset, FixedCamera());
  ASSERT_TRUE(run) << run.reason();
  const RobotSummary& robot = *run->result.robot;
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
    pose = pose * Rigid3d(ExpRotation(1e-4 * rng.Direction3()), 5e-5 * rng.Direction3());
  }
  made.dataset.target_poses = made.camera_from_target;
  made.dataset.given_detections.clear();
  RunOptions options;
  options.folds = 0;
  const Outcome<RunOutput> with_joints = heba::Run(made.dataset, options);
  ASSERT_TRUE(with_joints) << with_joints.reason();
  for (Capture& capture : made.dataset.captures) capture.joints.clear();
  const Outcome<RunOutput> run = heba::Run(made.dataset, options);
  ASSERT_TRUE(run) << run.reason();
  const RobotSummary& robot = *run->result.robot;
  ASSERT_TRUE(robot.is_estimated) << robot.reason.ToString();
  EXPECT_LT(robot.noise_after->translation_m, 1.3 * with_joints->result.robot->noise_after->translation_m);
}

// Noise must not look like a change of the configuration.
TEST(ArmClustersTest, PosesInOneConfigurationAreNotReadInSeveral) {
  for (const uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    ArmSceneOptions options;
    options.setup = Setup::kEyeInHand;
    options.has_several_configurations = false;
    options.num_captures = 40;
    const ArmScene scene = MakeArmScene(seed, options);
    Dataset dataset = DatasetOf(scene.scene, options.setup, Chessboard());
    dataset.given_detections.clear();
    dataset.robot = RobotArm{scene.nominal, scene.tip_from_gripper, {}};
    Rng rng(seed);
    for (const PosePair& pair : scene.scene.pairs) {
      const Eigen::Vector3d rotation_rad(6e-4 * rng.Normal(), 6e-4 * rng.Normal(), 6e-4 * rng.Normal());
      const Eigen::Vector3d translation_m(3e-4 * rng.Normal(), 3e-4 * rng.Normal(), 3e-4 * rng.Normal());
      dataset.target_poses.push_back(pair.camera_from_target * Rigid3d(ExpRotation(rotation_rad), translation_m));
    }
    RunOptions run_options;
    run_options.folds = 0;
    const Outcome<RunOutput> run = heba::Run(dataset, run_options);
    ASSERT_TRUE(run) << run.reason();
    EXPECT_NE(run->result.robot->configuration, "") << "seed " << seed << ": several";
  }
}

TEST(ArmClustersTest, CaptureWithWrongJointsIsLeftOutAndTheArmIsEstimated) {
  ArmDataset made = ThreeConfigurations(8, ArmSceneOptions(), 30, 10);
  made.dataset.captures[4].joints[2] = 1e9;
  RunOptions options = FixedCamera();
  options.folds = 0;
  const Outcome<RunOutput> run = heba::Run(made.dataset, options);
  ASSERT_TRUE(run) << run.reason();
  EXPECT_TRUE(run->result.robot->is_estimated) << run->result.robot->reason.ToString();
  EXPECT_THAT(LeftOutOf(run->result), testing::ElementsAre(made.dataset.captures[4].name));
  EXPECT_THAT(run->result.captures[4].reason, testing::HasSubstr("its joints or its pose are wrong"));
}

}  // namespace
}  // namespace heba
