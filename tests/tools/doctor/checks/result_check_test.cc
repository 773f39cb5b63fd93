// Tests of the check that reports the findings of the calibration: tools/doctor/checks/result.cc.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

// The intrinsics are held, so that a calibration is fast.
Examination CalibratedExamination(const SimulatedSetOptions& options = {}) {
  Examination examination = CleanExamination(options);
  examination.config.data.rig.cameras[0].free_intrinsics = {};
  return examination;
}

TEST(ResultCheckTest, CleanDataHaveNoFault) {
  SimulatedSetOptions options;
  options.num_captures = 15;
  Examination examination = CalibratedExamination(options);
  EXPECT_THAT(CodesOf(RunCheck(Check_result, &examination)), Not(Contains(StartsWith("wrong "))));
}

TEST(ResultCheckTest, SaysWhyThereIsNoResult) {
  Examination examination = CalibratedExamination();
  const std::vector<Rigid3d> poses(examination.config.data.captures.size(), Rigid3d());
  SetPoses(poses, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_result, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong no_result"));
  EXPECT_FALSE(symptoms[0].what.empty());
}

TEST(ResultCheckTest, IsSilentAfterAnotherFault) {
  Examination examination = CalibratedExamination();
  SetPoses(std::vector<Rigid3d>(examination.config.data.captures.size()), &examination);
  examination.found_wrong = true;
  EXPECT_THAT(CodesOf(RunCheck(Check_result, &examination)), IsEmpty());
}

// The doctor's copy of the data set stays whole: captures are left out as in a run, for this check only.
TEST(ResultCheckTest, DoesNotChangeTheExamination) {
  Examination examination = CalibratedExamination();
  CaptureDetection& seen = examination.detections[3].detection;
  seen.image_digest = "digest";
  examination.detections[7].detection = seen;
  RunCheck(Check_result, &examination);
  EXPECT_EQ(examination.config.data.captures.size(), 12u);
  EXPECT_EQ(examination.detections.size(), 12u);
}

}  // namespace
}  // namespace heba
