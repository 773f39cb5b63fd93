// Tests of the check whether the motion determines the hand-eye pose: tools/doctor/checks/motion.cc.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Returns an examination of captures with these robot rotations; the images do not matter to this check.
Examination ExaminationOf(const std::vector<Eigen::Vector3d>& rotation_vectors_rad) {
  Examination examination;
  for (size_t i = 0; i < rotation_vectors_rad.size(); ++i) {
    ExaminedView view;
    view.capture = i;
    view.view.camera_mount_from_target_mount = Rigid3d(
        ExpRotation(rotation_vectors_rad[i]), {0.1 * static_cast<double>(i), 0.02 * static_cast<double>(i * i), 0.5});
    examination.views.push_back(view);
  }
  return examination;
}

// Returns rotations whose rotation vectors are normally distributed.
std::vector<Eigen::Vector3d> Rotations(size_t num, const Eigen::Vector3d& sigma_rad) {
  Rng rng(1);
  std::vector<Eigen::Vector3d> rotations;
  for (size_t i = 0; i < num; ++i) rotations.emplace_back(sigma_rad.cwiseProduct(rng.NormalVector3()));
  return rotations;
}

TEST(MotionCheckTest, SufficientMotionHasNoSymptom) {
  Examination examination = ExaminationOf(Rotations(15, {0.4, 0.4, 0.4}));
  EXPECT_THAT(CodesOf(RunCheck(Check_motion, &examination)), IsEmpty());
}

TEST(MotionCheckTest, FindsTranslationsWithoutRotation) {
  Examination examination = ExaminationOf(Rotations(15, {0, 0, 0}));
  const std::vector<Symptom> symptoms = RunCheck(Check_motion, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong motion"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("rotations of at least 20 deg about two or three axes"));
}

TEST(MotionCheckTest, FindsRotationsAboutOneAxis) {
  Examination examination = ExaminationOf(Rotations(15, {0, 0, 0.5}));
  const std::vector<Symptom> symptoms = RunCheck(Check_motion, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong motion"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("about one axis only"));
}

TEST(MotionCheckTest, TwoCapturesAreTooFew) {
  Examination examination = ExaminationOf(Rotations(2, {0.4, 0.4, 0.4}));
  EXPECT_THAT(CodesOf(RunCheck(Check_motion, &examination)), ElementsAre("wrong few_captures"));
}

// The check that found out why the captures are few has already said so.
TEST(MotionCheckTest, TooFewCapturesAreNotReportedAfterAnotherFault) {
  Examination examination = ExaminationOf(Rotations(2, {0.4, 0.4, 0.4}));
  examination.found_wrong = true;
  EXPECT_THAT(CodesOf(RunCheck(Check_motion, &examination)), IsEmpty());
  examination = ExaminationOf(Rotations(15, {0, 0, 0.5}));
  examination.found_wrong = true;
  EXPECT_THAT(CodesOf(RunCheck(Check_motion, &examination)), ElementsAre("wrong motion"));
}

TEST(MotionCheckTest, RemarksOnFewerThanEightCaptures) {
  Examination seven = ExaminationOf(Rotations(7, {0.5, 0.5, 0.5}));
  const std::vector<Symptom> symptoms = RunCheck(Check_motion, &seven);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark few_captures"));
  EXPECT_EQ(symptoms[0].what, "only 7 captures can be used");
  Examination eight = ExaminationOf(Rotations(8, {0.5, 0.5, 0.5}));
  EXPECT_THAT(CodesOf(RunCheck(Check_motion, &eight)), IsEmpty());
}

TEST(MotionCheckTest, RemarksOnSmallRotationsAboutTheSecondAxis) {
  Examination examination = ExaminationOf(Rotations(15, {0.02, 0.06, 0.5}));
  const std::vector<Symptom> symptoms = RunCheck(Check_motion, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark little_rotation"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("deg about a second one"));
}

}  // namespace
}  // namespace heba
