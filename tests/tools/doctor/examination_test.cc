#include "tools/doctor/examination.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "tests/support/matchers.h"
#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::SizeIs;
using ::testing::StartsWith;

TEST(NumSeenTest, CountsImagesWithEnoughPointsForAPose) {
  std::vector<TargetDetection> detections(3);
  detections[0].detection.detection.ids = {0, 1, 2};
  detections[1].detection.detection.ids = {0, 1, 2, 3};
  EXPECT_EQ(NumSeen(detections), 1u);
}

TEST(ExamineViewsTest, ThePoseOfTheTargetIsTheFirstCandidate) {
  SimulatedSetOptions options;
  options.noise_px = 0;
  const TestScene scene = MakeChessboardScene(options);
  const Examination examination = ExaminationOf(scene, options.setup);
  ASSERT_THAT(examination.views, SizeIs(12));
  for (size_t i = 0; i < examination.views.size(); ++i) {
    const ExaminedView& view = examination.views[i];
    EXPECT_EQ(view.capture, i);
    EXPECT_THAT(view.camera_from_target.front(), IsNearPose(scene.pairs[i].camera_from_target, 1e-5, 1e-5));
    EXPECT_THAT(view.view.camera_mount_from_target_mount,
                IsNearPose(scene.views[i].camera_mount_from_target_mount, 1e-9, 1e-9));
    EXPECT_LT(view.rms_px, 1e-4);
  }
}

TEST(ExamineViewsTest, RmsIsThatOfTheNoise) {
  for (const ExaminedView& view : CleanExamination().views) {
    // The distance of a point has two coordinates of 0.1 px each.
    EXPECT_NEAR(view.rms_px, 0.14, 0.05);
  }
}

// The robot's pose of an eye-in-hand capture is inverted, because the target's mount is the base.
TEST(ExamineViewsTest, MountsFollowTheSetup) {
  SimulatedSetOptions options;
  options.setup = Setup::kEyeInHand;
  const Examination examination = CleanExamination(options);
  const ExaminedView& view = examination.views[3];
  EXPECT_THAT(view.view.camera_mount_from_target_mount,
              IsNearPose(Inverse(examination.config.data.captures[3].base_from_gripper[0]), 1e-9, 1e-9));
}

TEST(ExamineViewsTest, LeavesOutCapturesWithTooFewPoints) {
  Examination examination = CleanExamination();
  Detection& detection = examination.detections[1].detection.detection;
  detection.ids.resize(3);
  detection.pixels.resize(3);
  ExamineAgain(&examination);
  ASSERT_THAT(examination.views, SizeIs(11));
  EXPECT_EQ(examination.views[0].capture, 0u);
  EXPECT_EQ(examination.views[1].capture, 2u);
  EXPECT_EQ(examination.views[1].view.name, "view_2");
}

TEST(ExamineViewsTest, ASymmetricTargetHasTwiceAsManyCandidates) {
  Examination examination = CleanExamination();
  const size_t num_candidates = examination.views[0].camera_from_target.size();
  // The circles lie where the chessboard's corners are.
  examination.config.data.targets[0] = TargetOfYaml("{type: circle_grid, rows: 5, columns: 8, spacing: 25 mm}");
  const std::vector<Rigid3d> symmetries = examination.config.data.targets[0]->Symmetries();
  ASSERT_THAT(symmetries, SizeIs(2));
  ExamineAgain(&examination);
  const std::vector<Rigid3d>& candidates = examination.views[0].camera_from_target;
  EXPECT_EQ(candidates.size(), 2 * num_candidates);
  EXPECT_THAT(candidates[1], IsNearPose(candidates[0] * symmetries[1], 1e-9, 1e-9));
}

TEST(ViewsOfPosesTest, GivenPosesAreTheOnlyCandidates) {
  Dataset dataset = DatasetOf(Setup::kEyeToHand, nullptr);
  const Rigid3d base_from_gripper(ExpRotation({0.1, 0, 0}), {1, 0, 0});
  const Rigid3d camera_from_target(ExpRotation({0, 0.2, 0}), {0, 0, 0.5});
  dataset.captures = {{"sample_0", {base_from_gripper}, {""}, {}, CaptureRole::kRotate}};
  dataset.target_poses = {camera_from_target};
  const std::vector<ExaminedView> views = ViewsOfPoses(dataset);
  ASSERT_THAT(views, SizeIs(1));
  EXPECT_EQ(views[0].view.name, "sample_0");
  EXPECT_EQ(views[0].view.role, CaptureRole::kRotate);
  EXPECT_THAT(views[0].camera_from_target, ElementsAre(IsNearPose(camera_from_target, 1e-12, 1e-12)));
  EXPECT_THAT(views[0].view.camera_mount_from_target_mount, IsNearPose(base_from_gripper, 1e-12, 1e-12));
  const std::vector<PoseCandidates> candidates = CandidatesOf(views);
  ASSERT_THAT(candidates, SizeIs(1));
  EXPECT_THAT(candidates[0].camera_mount_from_target_mount, IsNearPose(base_from_gripper, 1e-12, 1e-12));
  EXPECT_THAT(candidates[0].camera_from_target, SizeIs(1));
}

TEST(WorkingDistanceTest, IsTheMeanDistanceOfTheFirstCandidates) {
  std::vector<ExaminedView> views(2);
  views[0].camera_from_target = {Rigid3d(Eigen::Quaterniond::Identity(), {0.3, 0, 0.4})};
  views[1].camera_from_target = {Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, 1}),
                                 Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, 100})};
  EXPECT_DOUBLE_EQ(WorkingDistanceM(views), 0.75);
}

TEST(MisfitTextTest, StatesDegreesAndMillimetres) {
  PoseConsistency consistency;
  consistency.typical_rotation_rad = DegToRad(23.4);
  consistency.typical_translation_m = 0.1834;
  EXPECT_EQ(MisfitText(consistency), "23 deg and 183 mm");
}

TEST(HandEyeTextTest, NamesTheMountOfTheCamera) {
  const Rigid3d pose(Eigen::Quaterniond::Identity(), {0.1, 0, 0});
  EXPECT_THAT(HandEyeText(Setup::kEyeToHand, pose), StartsWith("base_from_camera [100.0"));
  EXPECT_THAT(HandEyeText(Setup::kEyeInHand, pose), StartsWith("gripper_from_camera [100.0"));
}

}  // namespace
}  // namespace heba
