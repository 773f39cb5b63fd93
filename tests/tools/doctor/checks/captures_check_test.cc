// Tests of the check of single captures against the others: tools/doctor/checks/captures.cc.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Gives every image a digest of its own.
void GiveDigests(Examination* examination) {
  for (size_t i = 0; i < examination->detections.size(); ++i) {
    examination->detections[i].detection.image_digest = "digest" + std::to_string(i);
  }
}

TEST(CapturesCheckTest, CleanCapturesHaveNoSymptom) {
  Examination examination = CleanExamination();
  GiveDigests(&examination);
  EXPECT_THAT(CodesOf(RunCheck(Check_captures, &examination)), IsEmpty());
  EXPECT_THAT(examination.views, SizeIs(12));
}

// The robot stands still between two copies, so their poses differ by its noise only.
TEST(CapturesCheckTest, CopiesAreARemarkAndHiddenFromLaterChecks) {
  Examination examination = CleanExamination();
  GiveDigests(&examination);
  std::vector<Rigid3d> poses = PosesOf(examination);
  poses[7] = poses[3];
  poses[7].translation.x() += 2e-5;
  examination.detections[7].detection = examination.detections[3].detection;
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_captures, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark repeated_image"));
  EXPECT_EQ(symptoms[0].what,
            "1 of 12 captures repeat the image of another one, byte by byte, and its pose; for example, view_7 "
            "repeats view_3");
  ASSERT_THAT(examination.views, SizeIs(11));
  for (const ExaminedView& view : examination.views) EXPECT_NE(view.capture, 7u);
}

TEST(CapturesCheckTest, OneImageWithTwoPosesIsWrong) {
  Examination examination = CleanExamination();
  GiveDigests(&examination);
  examination.detections[7].detection = examination.detections[3].detection;
  ExamineAgain(&examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_captures, &examination);
  ASSERT_FALSE(symptoms.empty());
  EXPECT_EQ(CodesOf(symptoms)[0], "wrong same_picture");
  EXPECT_THAT(symptoms[0].what, HasSubstr("view_7 is the same image as view_3, byte by byte, but has another pose"));
}

TEST(CapturesCheckTest, OnePoseWithTwoImagesIsWrong) {
  Examination examination = CleanExamination();
  std::vector<Rigid3d> poses = PosesOf(examination);
  poses[7] = poses[3];
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_captures, &examination);
  ASSERT_FALSE(symptoms.empty());
  EXPECT_EQ(CodesOf(symptoms)[0], "wrong same_pose");
  EXPECT_THAT(symptoms[0].what, HasSubstr("view_3 and view_7 have the same robot pose, to the last digit"));
}

// A robot that returns to a pose sees the same again, which is no fault.
TEST(CapturesCheckTest, OnePoseWithAgreeingImagesIsNoFault) {
  Examination examination = CleanExamination();
  GiveDigests(&examination);
  std::vector<Rigid3d> poses = PosesOf(examination);
  poses[7] = poses[3];
  const std::string digest = examination.detections[7].detection.image_digest;
  examination.detections[7].detection = examination.detections[3].detection;
  examination.detections[7].detection.image_digest = digest;
  SetPoses(poses, &examination);
  EXPECT_THAT(CodesOf(RunCheck(Check_captures, &examination)), IsEmpty());
}

TEST(CapturesCheckTest, FindsTwoCapturesWithSwappedPoses) {
  Examination examination = CleanExamination();
  std::vector<Rigid3d> poses = PosesOf(examination);
  std::swap(poses[2], poses[9]);
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_captures, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong swapped"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("view_2 and view_9 are swapped: each fits the other's pose"));
  EXPECT_EQ(symptoms[0].cure, "swap their names in the poses file");
}

// The pose of view_3 stands in two rows, once with a digit changed, so that it is not the same to the last digit.
TEST(CapturesCheckTest, FindsACaptureWithThePoseOfAnother) {
  Examination examination = CleanExamination();
  std::vector<Rigid3d> poses = PosesOf(examination);
  const Rigid3d right = poses[7];
  poses[7] = poses[3];
  poses[3] = right;
  poses[7].translation.x() += 1e-6;
  std::swap(poses[3], poses[5]);
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_captures, &examination);
  ASSERT_FALSE(symptoms.empty());
  EXPECT_EQ(CodesOf(symptoms)[0], "wrong wrong_pose");
  EXPECT_THAT(symptoms[0].what, HasSubstr("fits the pose of "));
}

// The first captures determine the hand-eye pose; the images of the last quarter belong to the poses of their
// neighbours.
TEST(CapturesCheckTest, FindsPosesThatAreShiftedFromALateCaptureOn) {
  SimulatedSetOptions options;
  options.num_captures = 20;
  for (const int step : {1, -1}) {
    SCOPED_TRACE(step);
    Examination examination = CleanExamination(options);
    std::vector<Rigid3d> poses = PosesOf(examination);
    const std::vector<Rigid3d> right = poses;
    for (int i = 15; i < 20; ++i) {
      const int j = i - step;
      // One row holds a pose that no image has.
      poses[static_cast<size_t>(i)] = j >= 15 && j < 20
                                          ? right[static_cast<size_t>(j)]
                                          : right[0] * Rigid3d(Eigen::Quaterniond::Identity(), {0.2, 0, 0});
    }
    SetPoses(poses, &examination);
    const std::vector<Symptom> symptoms = RunCheck(Check_captures, &examination);
    ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong pairing"));
    EXPECT_THAT(symptoms[0].what,
                HasSubstr(step > 0 ? "from view_15 on, each image belongs to the pose 1 row further down"
                                   : "from view_16 on, each image belongs to the pose 1 row further up"));
  }
}

// Rows that change places are no shift: the image of the first belongs to the last.
TEST(CapturesCheckTest, DoesNotTakeRowsThatChangePlacesForAShift) {
  SimulatedSetOptions options;
  options.num_captures = 20;
  Examination examination = CleanExamination(options);
  std::vector<Rigid3d> poses = PosesOf(examination);
  std::rotate(poses.begin() + 16, poses.begin() + 17, poses.end());
  SetPoses(poses, &examination);
  for (const Symptom& symptom : RunCheck(Check_captures, &examination)) EXPECT_NE(symptom.code.name(), "pairing");
}

// The shift is that of more rows than the doctor lists.
TEST(CapturesCheckTest, FindsPosesThatAreShiftedInManyRows) {
  SimulatedSetOptions options;
  options.num_captures = 600;
  Examination examination = CleanExamination(options);
  std::vector<Rigid3d> poses = PosesOf(examination);
  poses.erase(poses.begin() + 440);
  poses.push_back(poses[0] * Rigid3d(Eigen::Quaterniond::Identity(), {0.2, 0, 0}));
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_captures, &examination);
  ASSERT_FALSE(symptoms.empty());
  EXPECT_EQ(CodesOf(symptoms)[0], "wrong pairing");
  EXPECT_THAT(symptoms[0].what, HasSubstr("from view_441 on, each image belongs to the pose 1 row further up"));
}

TEST(CapturesCheckTest, RemarksOnACaptureThatContradictsTheOthers) {
  Examination examination = CleanExamination();
  std::vector<Rigid3d> poses = PosesOf(examination);
  poses[4] = poses[4] * Rigid3d(ExpRotation({0, 0.5, 0}), {0, 0.2, 0});
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_captures, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark contradicts"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("1 capture contradicts the others"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("view_4 ("));
}

// All poses are off by more than a twentieth of the working distance, one of them by several times as much.
TEST(CapturesCheckTest, IsSilentIfNothingFits) {
  Examination examination = CleanExamination();
  Rng rng(3);
  std::vector<Rigid3d> poses = PosesOf(examination);
  for (Rigid3d& pose : poses) {
    pose = pose * Rigid3d{ExpRotation(0.05 * rng.NormalVector3()), 0.04 * rng.NormalVector3()};
  }
  poses[4] = poses[4] * Rigid3d(ExpRotation({0, 2, 0}), {0, 0.2, 0});
  SetPoses(poses, &examination);
  EXPECT_THAT(CodesOf(RunCheck(Check_captures, &examination)), IsEmpty());
}

}  // namespace
}  // namespace heba
