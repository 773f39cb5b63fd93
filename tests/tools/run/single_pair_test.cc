// A camera, a target and an arm with names give what they give without: tools/run/pair_images.h.
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/evaluation/verdict.h"
#include "heba/run.h"
#include "tests/support/arm_scenes.h"
#include "tests/support/datasets.h"
#include "tests/support/scenes.h"
#include "tools/pages/report.h"

namespace heba {
namespace {
using ::testing::ElementsAreArray;

// A data set of a scene, and what is wrong with it.
struct Case {
  std::string name;
  Setup setup;
  bool is_camera_given = true;
  double noise_of_arm_m = 0;  // One sigma of each coordinate.
  void (*spoil)(Dataset* dataset) = [](Dataset*) {};
};

void GiveWrongPose(Dataset* dataset) { dataset->captures[3].base_from_gripper[0].translation.x() += 0.02; }

void RepeatImage(Dataset* dataset) {
  dataset->given_detections[5].detection = dataset->given_detections[4].detection;
  dataset->captures[5].base_from_gripper = dataset->captures[4].base_from_gripper;
}

void HideTarget(Dataset* dataset) { dataset->given_detections[2].detection.detection = Detection(); }

void KeepFew(Dataset* dataset) { *dataset = PartOf(*dataset, {0, 1, 2, 3, 4}); }

const Case kCases[] = {
    {"in_hand", Setup::kEyeInHand},
    {"to_hand", Setup::kEyeToHand},
    {"noisy_arm", Setup::kEyeToHand, true, 3e-4},
    {"estimated_camera", Setup::kEyeInHand, false},
    {"wrong_pose", Setup::kEyeInHand, true, 1e-4, GiveWrongPose},
    {"repeated_image", Setup::kEyeInHand, true, 0, RepeatImage},
    {"hidden_target", Setup::kEyeToHand, true, 0, HideTarget},
    {"few_captures", Setup::kEyeInHand, true, 1e-4, KeepFew},
};

Dataset DatasetOf(const Case& of) {
  const std::shared_ptr<const Target> target = ParseTarget("{type: chessboard, rows: 6, columns: 9, square: 20 mm}");
  TestSceneOptions options;
  options.setup = of.setup;
  options.camera = {"pinhole", 1280, 960, {1000, 1000, 640, 480}};
  options.num_captures = 14;
  options.noise_px = 0.1;
  options.robot_translation_m = of.noise_of_arm_m;
  options.points = AllPoints(*target).points_in_target;
  Dataset dataset = heba::DatasetOf(MakeTestScene(7, options), of.setup, target);
  if (!of.is_camera_given) {
    dataset.has_camera = {false};
    dataset.rig.cameras[0].camera = {"pinhole", 0, 0, {}};
  }
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    dataset.captures[i].name = dataset.given_detections[i].detection.image_digest = std::to_string(i) + ".png";
    dataset.captures[i].images = {dataset.captures[i].name};
  }
  of.spoil(&dataset);
  return dataset;
}

Dataset Named(Dataset dataset) {
  dataset.rig.cameras[0].name = "top";
  dataset.rig.targets[0].name = "plate";
  dataset.rig.robots[0] = "robot";
  return dataset;
}

std::vector<std::string> CodesOf(const Verdict& verdict) {
  std::vector<std::string> codes;
  for (const Finding& finding : verdict.findings) {
    codes.push_back(std::string(GradeName(finding.grade)) + " " + std::string(finding.code));
  }
  return codes;
}

class SinglePairTest : public ::testing::TestWithParam<Case> {};

TEST_P(SinglePairTest, IsTheSingleCamera) {
  const Dataset dataset = DatasetOf(GetParam());
  const Outcome<RunOutput> single = heba::Run(dataset, RunOptions());
  const Outcome<RunOutput> pair = heba::Run(Named(dataset), RunOptions());
  ASSERT_TRUE(single) << single.reason();
  ASSERT_TRUE(pair) << pair.reason();

  const Estimate& refined = *FindRefined(single->result);
  const RunResult& result = pair->result;
  const Rigid3d& pose = result.solution.poses.mount_from_camera[0];
  EXPECT_LT(DistanceM(pose, refined.hand_eye.camera_mount_from_camera), 1e-12);
  EXPECT_LT(AngleRad(pose, refined.hand_eye.camera_mount_from_camera), 1e-7);
  const auto covariance = PoseCovarianceOf(result.solution.covariance, "cameras.top.pose");
  const auto of_single = PoseCovarianceOf(refined.solution->covariance, kHandEyeBlock);
  ASSERT_TRUE(covariance && of_single);
  EXPECT_LT((*covariance - *of_single).norm(), 1e-9 * of_single->norm());
  EXPECT_EQ(result.verdict.grade, single->result.verdict.grade);
  EXPECT_THAT(CodesOf(result.verdict), ElementsAreArray(CodesOf(single->result.verdict)));
  EXPECT_EQ(result.errors[0].holdout_target_mm, refined.errors.holdout_target_mm);
  EXPECT_EQ(result.errors[0].holdout_rms_px, refined.errors.holdout_rms_px);
  EXPECT_EQ(result.holdout_chi2, refined.errors.holdout_chi2);
  ASSERT_EQ(result.images.size(), single->result.images.size());
  for (size_t i = 0; i < result.images.size(); ++i) {
    const ImageResult& capture = single->result.images[i];
    EXPECT_EQ(result.images[i].camera, "top");
    EXPECT_EQ(result.images[i].capture, capture.image);
    EXPECT_EQ(result.images[i].used, capture.used);
    EXPECT_EQ(result.images[i].reason, capture.reason);
  }
  ASSERT_EQ(result.captures.size(), dataset.captures.size());
  EXPECT_EQ(pair->calibration.problem.captures.size(), dataset.captures.size());
  EXPECT_EQ(pair->calibration.refined->covariance.layout.size(), refined.solution->covariance.layout.size());
}

INSTANTIATE_TEST_SUITE_P(Scenes, SinglePairTest, ::testing::ValuesIn(kCases),
                         [](const auto& test) { return test.param.name; });

// The errors of an arm are parts of both results, of which pages are made.
TEST(SinglePairTest, RequirementMayNameTheCamera) {
  const Dataset dataset = DatasetOf(kCases[0]);
  RunOptions options = WithoutFolds();
  options.requirements = {{0.5, 0.95, {}, ""}};
  const Outcome<RunOutput> single = heba::Run(dataset, options);
  options.requirements.front().camera = "top";
  const Outcome<RunOutput> pair = heba::Run(Named(dataset), options);
  ASSERT_TRUE(single && pair);
  ASSERT_EQ(single->result.requirements.size(), size_t{1});
  ASSERT_EQ(pair->result.requirements.size(), size_t{1});
  EXPECT_EQ(pair->result.requirements[0].requirement.reached_m, single->result.requirements[0].requirement.reached_m);
}

TEST(SinglePairTest, ArmIsThatOfTheSingleCamera) {
  const std::shared_ptr<const Target> target = ParseTarget("{type: chessboard, rows: 6, columns: 8, square: 30 mm}");
  ArmSceneOptions scene_options;
  scene_options.setup = Setup::kEyeInHand;
  scene_options.points = AllPoints(*target).points_in_target;
  const ArmScene scene = MakeArmScene(3, scene_options);
  Dataset dataset = heba::DatasetOf(scene.scene, scene_options.setup, target);
  SetArm(scene, &dataset);
  dataset = WithFixedCamera(std::move(dataset));
  const Outcome<RunOutput> single = heba::Run(dataset, WithoutFolds());
  const Outcome<RunOutput> pair = heba::Run(Named(dataset), WithoutFolds());
  ASSERT_TRUE(single) << single.reason();
  ASSERT_TRUE(pair) << pair.reason();
  ASSERT_TRUE(pair->result.arms[0]->is_estimated) << pair->result.arms[0]->reason.ToString();
  EXPECT_LT((pair->result.arms[0]->errors - single->result.arms[0]->errors).norm(), 1e-12);
  EXPECT_EQ(pair->result.solution.effects[0].size(), pair->result.rig.effects[0]->size());
  EXPECT_FALSE(ReportPage(ReportDataOf(*pair), {}).empty());
}

}  // namespace
}  // namespace heba
