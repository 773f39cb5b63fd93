// Tests of the remarks on what no data can determine: tools/doctor/checks/setup.cc and symmetry.cc.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(SetupCheckTest, StatesBothSetupsForEyeToHand) {
  Examination examination = CleanExamination();
  const std::vector<Symptom> symptoms = RunCheck(Check_setup, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark either_set_up"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the camera is fixed beside the robot, roughly base_from_camera ["));
  EXPECT_THAT(symptoms[0].what, HasSubstr("a camera that is carried by the robot, with inverted poses, equally well: "
                                          "gripper_from_camera ["));
}

TEST(SetupCheckTest, StatesBothSetupsForEyeInHand) {
  SimulatedSetOptions options;
  options.setup = Setup::kEyeInHand;
  Examination examination = CleanExamination(options);
  const std::vector<Symptom> symptoms = RunCheck(Check_setup, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark either_set_up"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the camera is carried by the robot, roughly gripper_from_camera ["));
  EXPECT_THAT(symptoms[0].what, HasSubstr("base_from_camera ["));
}

TEST(SetupCheckTest, IsSilentAfterAFaultAndWithTooFewCaptures) {
  Examination examination = CleanExamination();
  examination.found_wrong = true;
  EXPECT_THAT(CodesOf(RunCheck(Check_setup, &examination)), IsEmpty());
  SimulatedSetOptions options;
  options.num_captures = 4;
  Examination few = CleanExamination(options);
  EXPECT_THAT(CodesOf(RunCheck(Check_setup, &few)), IsEmpty());
}

TEST(SymmetryCheckTest, RemarksOnATargetThatLooksTheSameAfterARotation) {
  Examination examination;
  examination.config.data.targets = {TargetOfYaml("{type: chessboard, rows: 6, columns: 8, square: 20 mm}")};
  const std::vector<Symptom> symptoms = RunCheck(Check_symmetry, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark symmetric_target"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the target looks the same after a rotation by 180 deg"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("columns: 9"));
}

TEST(SymmetryCheckTest, IsSilentForATargetWithOneOrientation) {
  Examination examination;
  examination.config.data.targets = {TargetOfYaml(kChessboardYaml)};
  EXPECT_THAT(CodesOf(RunCheck(Check_symmetry, &examination)), IsEmpty());
}

}  // namespace
}  // namespace heba
