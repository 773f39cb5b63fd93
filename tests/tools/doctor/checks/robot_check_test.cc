// Tests of the check whether joints and poses are those of the arm: tools/doctor/checks/robot.cc.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/robot/arm_postures.h"
#include "heba/robot/arm_table.h"
#include "tests/support/arm_scenes.h"
#include "tests/support/data_sets.h"
#include "tests/tools/doctor/examinations.h"

namespace heba {
namespace {
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr Setup kSetup = Setup::kEyeInHand;

// A cell with a UR5e of usual errors, in one configuration.
ArmScene UrScene(const Rigid3d& tip_from_gripper = Rigid3d()) {
  ArmSceneOptions options;
  options.setup = kSetup;
  options.has_several_configurations = false;
  options.tip_from_gripper = tip_from_gripper;
  options.points = AllPoints(*TargetOfYaml(kChessboardYaml)).points_in_target;
  return MakeArmScene(3, options);
}

// A tool of this length along the flange's z axis.
Rigid3d ToolOf(double length_m) { return {Eigen::Quaterniond::Identity(), {0, 0, length_m}}; }

// The config names this arm and no tool.
Examination ExaminationWith(const ArmScene& scene, const std::string& arm, bool records_joints) {
  Examination examination = ExaminationOf(scene.scene, kSetup);
  Dataset& data = examination.config.data;
  // The intrinsics are held, so that a calibration is fast.
  data = WithFixedCamera(std::move(data));
  if (records_joints) SetArm(scene, &data);
  data.arms = {RobotArm{*FindArm(arm), {}, {}}};
  examination.config.options.calibration.adjustment.robot = BundleOptions::Robot::kEstimatedNoise;
  return examination;
}

TEST(RobotCheckTest, ConfigsWithoutArmHaveNoSymptom) {
  Examination examination = CleanExamination();
  EXPECT_THAT(CodesOf(RunCheck(Check_robot, &examination)), IsEmpty());
}

TEST(RobotCheckTest, RightArmWithoutJointsHasNoSymptom) {
  Examination examination = ExaminationWith(UrScene(), "ur5e", false);
  EXPECT_THAT(CodesOf(RunCheck(Check_robot, &examination)), IsEmpty());
}

// A ur10e reaches all poses of this ur5e, a ur5 does not.
TEST(RobotCheckTest, SimilarArmIsNamedByTheCaptures) {
  for (const auto& [wrong, code] :
       {std::pair("ur10e", "wrong robot_model"), std::pair("ur5", "wrong robot_unreachable")}) {
    Examination examination = ExaminationWith(UrScene(), wrong, false);
    const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
    ASSERT_THAT(CodesOf(symptoms), ElementsAre(code)) << wrong;
    EXPECT_THAT(symptoms[0].cure, StartsWith("set robot.model: ur5e"));
    if (std::string_view(wrong) == "ur10e") {
      EXPECT_EQ(symptoms[0].settings, (std::vector<ConfigSetting>{{"robot.model", "ur5e"}}));
    }
  }
}

TEST(RobotCheckTest, ForgottenToolIsFoundByTheCaptures) {
  const Rigid3d tool = ToolOf(0.1);
  Examination examination = ExaminationWith(UrScene(tool), "ur5e", false);
  const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong robot_tool"));
  // The length is found in steps of 6 mm; the captures determine it to about 10 mm.
  const size_t at = symptoms[0].what.find("a tool of about ");
  ASSERT_NE(at, std::string::npos) << symptoms[0].what;
  EXPECT_NEAR(std::stod(symptoms[0].what.substr(at + 16)), 100, 20) << symptoms[0].what;
  EXPECT_THAT(symptoms[0].what, HasSubstr("mm along the flange's z axis"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("set robot.tool"));
  examination.config.data.arms[0]->tip_from_gripper = tool;
  EXPECT_THAT(CodesOf(RunCheck(Check_robot, &examination)), IsEmpty());
}

// The config names a longer tool than that of the poses, with which the arm does not reach them. The tool is beside the
// flange's axis, so that no tool along that axis explains the poses.
TEST(RobotCheckTest, AToolThatIsTooLongShouldBeShorter) {
  const Rigid3d beside(Eigen::Quaterniond::Identity(), {0.08, 0, 0});
  Examination examination = ExaminationWith(UrScene(beside * ToolOf(0.1)), "ur5e", false);
  examination.config.data.arms[0]->tip_from_gripper = beside * ToolOf(0.45);
  const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong robot_unreachable"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("mm shorter along the flange's z axis than robot.tool says"));
}

TEST(RobotCheckTest, ArmThatDoesNotReachThePosesIsWrong) {
  Examination examination = ExaminationWith(UrScene(), "ur3e", false);
  const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong robot_unreachable"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("the arm ur5e"));
  EXPECT_EQ(symptoms[0].cure, "set robot.model: ur5e");
}

TEST(RobotCheckTest, OtherFaultsComeFirst) {
  Examination examination = ExaminationWith(UrScene(), "ur3e", false);
  examination.found_wrong = true;
  EXPECT_THAT(CodesOf(RunCheck(Check_robot, &examination)), IsEmpty());
}

TEST(RobotCheckTest, RecordedJointsTellTheNominalKinematics) {
  Examination examination = ExaminationWith(UrScene(), "ur5e", true);
  const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark nominal_kinematics"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("refine.kinematics"));
}

TEST(RobotCheckTest, RecordedJointsTellTheTool) {
  Examination examination =
      ExaminationWith(UrScene(Rigid3d(Eigen::Quaterniond::Identity(), {0, 0, 0.1})), "ur5e", true);
  const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("remark robot_tool", "remark nominal_kinematics"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("[0.000, 0.000, 100.000] mm"));
}

TEST(RobotCheckTest, RecordedJointsTellACalibratedController) {
  const ArmScene scene = UrScene();
  Examination examination = ExaminationWith(scene, "ur5e", true);
  const Arm calibrated = WithChanges(scene.nominal, scene.errors);
  for (size_t i = 0; i < scene.joints.size(); ++i) {
    examination.config.data.captures[i].base_from_gripper[0] = BaseFromTip(calibrated, scene.joints[i]);
  }
  EXPECT_THAT(CodesOf(RunCheck(Check_robot, &examination)), Contains("remark calibrated_kinematics"));
  EXPECT_THAT(CodesOf(RunCheck(Check_robot, &examination)), Not(Contains(StartsWith("wrong "))));
}

TEST(RobotCheckTest, RoundedJointsAreNoCalibration) {
  const ArmScene scene = UrScene();
  Examination examination = ExaminationWith(scene, "ur5e", true);
  for (Recording& capture : examination.config.data.captures) {
    for (double& joint : capture.joints[0]) joint = DegToRad(0.01 * std::round(100 * RadToDeg(joint)));
  }
  examination.config.arms[0].joints_are_deg = true;
  EXPECT_THAT(CodesOf(RunCheck(Check_robot, &examination)), ElementsAre("remark nominal_kinematics"));
}

TEST(RobotCheckTest, RecordedJointsTellTheArm) {
  for (const std::string wrong : {"ur10e", "ur5"}) {
    Examination examination = ExaminationWith(UrScene(), wrong, true);
    const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
    ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong robot_model")) << wrong;
    EXPECT_EQ(symptoms[0].cure, "set robot.model: ur5e");
  }
}

// Replaces the joints of all captures.
void SetJoints(const std::vector<Eigen::VectorXd>& joints, Examination* examination) {
  for (size_t i = 0; i < joints.size(); ++i) {
    examination->config.data.captures[i].joints = {{joints[i].begin(), joints[i].end()}};
  }
}

TEST(RobotCheckTest, UnitOfTheJointsIsFound) {
  const ArmScene scene = UrScene();
  Examination examination = ExaminationWith(scene, "ur5e", true);
  std::vector<Eigen::VectorXd> joints = scene.joints;
  for (Eigen::VectorXd& of_capture : joints) of_capture *= RadToDeg(1);
  SetJoints(joints, &examination);
  std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong joint_angle"));
  EXPECT_EQ(symptoms[0].cure, "set captures.joint_angle: deg");
  EXPECT_EQ(symptoms[0].settings, (std::vector<ConfigSetting>{{"captures.joint_angle", "deg"}}));
  for (Eigen::VectorXd& of_capture : joints) of_capture *= DegToRad(1) * DegToRad(1);
  SetJoints(joints, &examination);
  examination.config.arms[0].joints_are_deg = true;
  symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong joint_angle"));
  EXPECT_EQ(symptoms[0].cure, "set captures.joint_angle: rad");
}

TEST(RobotCheckTest, OrderOfTheJointsIsFound) {
  const ArmScene scene = UrScene();
  Examination examination = ExaminationWith(scene, "ur5e", true);
  std::vector<Eigen::VectorXd> joints = scene.joints;
  std::rotate(joints.begin(), joints.begin() + 2, joints.end());
  SetJoints(joints, &examination);
  std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong joint_pairing"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("2 rows further up"));
  joints = scene.joints;
  std::reverse(joints.begin(), joints.end());
  SetJoints(joints, &examination);
  symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong joint_pairing"));
  EXPECT_THAT(symptoms[0].what, HasSubstr("reverse order"));
}

TEST(RobotCheckTest, OtherBaseIsFound) {
  const ArmScene scene = UrScene();
  const Rigid3d rotated(ExpRotation({0, 0, kPi}), Eigen::Vector3d::Zero());
  const Rigid3d elsewhere(ExpRotation({0.2, -0.1, 0.4}), {0.3, -0.2, 0.8});
  for (const Rigid3d& base : {rotated, elsewhere}) {
    Examination examination = ExaminationWith(scene, "ur5e", true);
    for (Recording& capture : examination.config.data.captures) {
      capture.base_from_gripper[0] = base * capture.base_from_gripper[0];
    }
    const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
    ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong robot_base"));
    const bool is_rotated = base.translation.isZero();
    EXPECT_THAT(symptoms[0].what, HasSubstr(is_rotated ? "rotated by 180 deg about z" : "another base"));
    EXPECT_THAT(symptoms[0].cure, HasSubstr(is_rotated ? "base_link" : "multiply them by that pose"));
  }
}

// The unit of the joints can be set, their order cannot: the setting alone would not cure the config.
TEST(RobotCheckTest, SettingsThatAreOnlyAPartOfTheCureAreLeftOut) {
  const ArmScene scene = UrScene();
  Examination examination = ExaminationWith(scene, "ur5e", true);
  std::vector<Eigen::VectorXd> joints = scene.joints;
  std::rotate(joints.begin(), joints.begin() + 2, joints.end());
  for (Eigen::VectorXd& of_capture : joints) of_capture *= RadToDeg(1);
  SetJoints(joints, &examination);
  const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(symptoms, SizeIs(1));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("set captures.joint_angle: deg"));
  EXPECT_THAT(symptoms[0].cure, HasSubstr("correct the order of the file of joints"));
  EXPECT_TRUE(symptoms[0].settings.empty());
}

TEST(RobotCheckTest, JointsOfOtherPosesAreWrong) {
  const ArmScene scene = UrScene();
  Examination examination = ExaminationWith(scene, "ur5e", true);
  std::vector<Eigen::VectorXd> joints = scene.joints;
  Rng rng(5);
  for (Eigen::VectorXd& of_capture : joints) {
    for (double& joint : of_capture) joint = rng.Uniform(-kPi, kPi);
  }
  SetJoints(joints, &examination);
  EXPECT_THAT(CodesOf(RunCheck(Check_robot, &examination)), ElementsAre("wrong joints_unexplained"));
}

// The controller of this arm reports nominal kinematics, of a tool that is not the flange.
TEST(RobotCheckTest, RecordedFrankaReportsNominalKinematics) {
  const std::filesystem::path folder = DataDir() / "fr3_joints_pose_pairs";
  HEBA_SKIP_WITHOUT(folder);
  const std::vector<std::vector<double>> joints = ReadRecordedNumbers(folder / "joints.csv");
  const std::vector<std::vector<double>> tips = ReadRecordedNumbers(folder / "tcp.csv");
  Examination examination;
  Dataset& data = examination.config.data;
  data = DatasetOf(Setup::kEyeInHand, nullptr);
  examination.config.arms.emplace_back();
  for (size_t i = 0; i < joints.size(); ++i) {
    const std::vector<double>& tip = tips[i];
    const Rigid3d pose(Eigen::Quaterniond(tip[6], tip[3], tip[4], tip[5]), Eigen::Vector3d(tip[0], tip[1], tip[2]));
    data.captures.push_back({"", {pose}, {""}, {joints[i]}});
  }
  data.arms = {RobotArm{*FindArm("franka_fr3"), {}, {}}};
  EXPECT_THAT(CodesOf(RunCheck(Check_robot, &examination)),
              ElementsAre("remark robot_tool", "remark nominal_kinematics"));
  data.arms[0]->arm = *FindArm("kuka_iiwa7");
  const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), ElementsAre("wrong robot_model"));
  // Both of Franka's arms have these dimensions.
  EXPECT_THAT(symptoms[0].cure, StartsWith("set robot.model: franka_"));
}

TEST(RobotCheckTest, SingularCapturesAreNamed) {
  const ArmScene scene = UrScene();
  Examination examination = ExaminationWith(scene, "ur5e", true);
  std::vector<Eigen::VectorXd> joints = scene.joints;
  joints[4][4] = 0;
  SetJoints(joints, &examination);
  examination.config.data.captures[4].base_from_gripper[0] = BaseFromTip(scene.nominal, joints[4]);
  const std::vector<Symptom> symptoms = RunCheck(Check_robot, &examination);
  ASSERT_THAT(CodesOf(symptoms), Contains("remark singular_captures"));
  EXPECT_THAT(symptoms.back().what, HasSubstr("view_4: a common motion of joints"));
}

}  // namespace
}  // namespace heba
