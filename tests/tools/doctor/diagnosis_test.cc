#include "tools/doctor/doctor.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Returns a data set that consists of the robot's and the target's poses, without images.
RunConfig PosesOnly(const SimulatedSetOptions& options = {}) {
  const TestScene scene = MakeChessboardScene(options);
  RunConfig config = ExaminationOf(scene, options.setup).config;
  config.data.given_detections.clear();
  config.data.has_camera = {false};
  config.data.rig.cameras[0].camera = Camera();
  for (const PosePair& pair : scene.pairs) config.data.target_poses.push_back(pair.camera_from_target);
  return config;
}

TEST(DiagnosisTest, GoodPosesHaveOnlyTheRemarkOnTheSetup) {
  const Diagnosis diagnosis = DiagnosePair(PosesOnly(), 1, Verbosity::kQuiet);
  EXPECT_EQ(diagnosis.num_captures, 12);
  EXPECT_EQ(diagnosis.num_seen, 12);
  EXPECT_THAT(CodesOf(diagnosis.symptoms), ElementsAre("remark either_set_up"));
  EXPECT_EQ(diagnosis.NumWrong(), 0);
  EXPECT_EQ(FirstWrong(diagnosis), "");
  ASSERT_TRUE(diagnosis.pose_fit.has_value());
  EXPECT_TRUE(diagnosis.pose_fit->fits);
}

TEST(DiagnosisTest, GoodDetectionsHaveNoFault) {
  const Diagnosis diagnosis = DiagnosePair(CleanExamination().config, 1, Verbosity::kQuiet, Examine::kInputs);
  EXPECT_EQ(diagnosis.num_captures, 12);
  EXPECT_EQ(diagnosis.num_seen, 12);
  EXPECT_THAT(CodesOf(diagnosis.symptoms), ElementsAre("remark either_set_up"));
}

TEST(DiagnosisTest, CapturesWithoutATargetAreNotSeen) {
  RunConfig config = CleanExamination().config;
  config.data.given_detections[5].detection.detection = Detection();
  const Diagnosis diagnosis = DiagnosePair(config, 1, Verbosity::kQuiet, Examine::kInputs);
  EXPECT_EQ(diagnosis.num_captures, 12);
  EXPECT_EQ(diagnosis.num_seen, 11);
}

// The check of the motion and the verdict of the run both find that there are few captures.
TEST(DiagnosisTest, FindingsThatAnotherCheckReportedAreNotRepeated) {
  SimulatedSetOptions options;
  options.num_captures = 7;
  RunConfig config = CleanExamination(options).config;
  config.data.rig.cameras[0].free_intrinsics = {};
  const std::vector<std::string> codes = CodesOf(DiagnosePair(config, 1, Verbosity::kQuiet).symptoms);
  EXPECT_EQ(std::count(codes.begin(), codes.end(), "remark few_captures"), 1);
}

// The fault of the poses is corrected before the captures are checked, which then fit.
TEST(DiagnosisTest, AFaultDoesNotCauseOthers) {
  RunConfig config = PosesOnly();
  PosesFileOfArm& arm = config.arms.front();
  for (size_t i = 0; i < config.data.captures.size(); ++i) {
    Rigid3d& pose = config.data.captures[i].base_from_gripper[0];
    pose = Inverse(pose);
    arm.numbers[i] = NumbersFromPose(arm.reading.format, pose);
  }
  const Diagnosis diagnosis = DiagnosePair(config, 1, Verbosity::kQuiet);
  EXPECT_THAT(CodesOf(diagnosis.symptoms), ElementsAre("wrong pose_direction"));
  EXPECT_EQ(diagnosis.NumWrong(), 1);
  EXPECT_EQ(FirstWrong(diagnosis), diagnosis.symptoms[0].what + "; " + diagnosis.symptoms[0].cure);
}

TEST(DiagnosisTest, FaultsPrecedeRemarks) {
  SimulatedSetOptions options;
  options.num_captures = 7;
  RunConfig config = PosesOnly(options);
  std::swap(config.data.captures[1].base_from_gripper, config.data.captures[4].base_from_gripper);
  std::swap(config.arms[0].numbers[1], config.arms[0].numbers[4]);
  const Diagnosis diagnosis = DiagnosePair(config, 1, Verbosity::kQuiet);
  EXPECT_THAT(CodesOf(diagnosis.symptoms), ElementsAre("wrong swapped", "remark few_captures"));
}

TEST(FirstWrongTest, ACureIsAppendedIfThereIsOne) {
  Diagnosis diagnosis;
  EXPECT_EQ(FirstWrong(diagnosis), "");
  diagnosis.symptoms = {{Severity::kWrong, "no_result", "no convergence", ""}};
  EXPECT_EQ(FirstWrong(diagnosis), "no convergence");
  diagnosis.symptoms[0].cure = "take more captures";
  EXPECT_EQ(FirstWrong(diagnosis), "no convergence; take more captures");
  diagnosis.symptoms[0].severity = Severity::kRemark;
  EXPECT_EQ(FirstWrong(diagnosis), "");
}

// The fault of the inputs is the cause of the failure, which is not told beside it.
TEST(WithDiagnosisTest, TellsTheCauseOrTheReason) {
  Diagnosis diagnosis;
  EXPECT_EQ(WithDiagnosis("the refinement did not converge", diagnosis), "the refinement did not converge");
  diagnosis.symptoms = {{Severity::kWrong, "pairing", "images and poses are paired wrongly", "correct the rows"}};
  diagnosis.symptoms[0].evidence = "they differ by 3 mm";
  EXPECT_EQ(WithDiagnosis("the refinement did not converge", diagnosis),
            "heba doctor: images and poses are paired wrongly; correct the rows");
  EXPECT_EQ(WithDiagnosis("images and poses are paired wrongly: shifted", diagnosis),
            "images and poses are paired wrongly: shifted; correct the rows");
}

// A calibration leaves single captures out, so that they are not why it failed.
TEST(WithDiagnosisTest, TellsSingleCapturesAfterTheReason) {
  Diagnosis diagnosis;
  diagnosis.symptoms = {{Severity::kWrong, "swapped", "1.png and 2.png are swapped", "swap their names"}};
  EXPECT_EQ(WithDiagnosis("camera top saw no target", diagnosis),
            "camera top saw no target; heba doctor: 1.png and 2.png are swapped");
}

}  // namespace
}  // namespace heba
