// Tests of the recovery of an arm's joints from poses: tools/run/arm_setup.h.
#include "tools/run/arm_setup.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/robot/arm_postures.h"
#include "heba/robot/arm_table.h"
#include "heba/run.h"
#include "tools/run/arm_assessment.h"
#include "tools/text/finding_text.h"

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr size_t kSingular = 3;

// Returns the joints of captures in one configuration of a UR5e. In one of them, axes 4 and 6 are parallel.
std::vector<Eigen::VectorXd> JointsWithSingularCapture() {
  Rng rng(4);
  std::vector<Eigen::VectorXd> all;
  for (size_t i = 0; i < 8; ++i) {
    Eigen::VectorXd joints(6);
    joints << 0.3, -1.3, 1.5, -1.4, -1.2, 0.5;
    for (double& joint : joints) joint += rng.Uniform(-0.3, 0.3);
    if (i == kSingular) joints[4] = 0;
    all.push_back(joints);
  }
  return all;
}

Dataset DatasetOf(const std::vector<Eigen::VectorXd>& joints, bool records_joints) {
  Dataset dataset = DatasetOf(Setup::kEyeToHand, nullptr);
  const RobotArm robot{*FindArm("ur5e"), Rigid3d(ExpRotation({0.1, 0.2, 0.3}), {0.01, 0.02, 0.15}), {}};
  dataset.arms = {robot};
  for (const Eigen::VectorXd& of_capture : joints) {
    const std::string name = std::to_string(dataset.captures.size()) + ".png";
    dataset.captures.push_back({name, {BaseFromTip(robot.arm, of_capture) * robot.tip_from_gripper}, {name}});
    if (records_joints) dataset.captures.back().joints = {{of_capture.begin(), of_capture.end()}};
  }
  return dataset;
}

double DistanceRad(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  double distance_rad = 0;
  for (Eigen::Index j = 0; j < a.size(); ++j) {
    distance_rad = std::max(distance_rad, std::abs(std::remainder(a[j] - b[j], 2 * kPi)));
  }
  return distance_rad;
}

TEST(ArmSetupTest, SingularCaptureDoesNotEndAConfiguration) {
  const std::vector<Eigen::VectorXd> joints = JointsWithSingularCapture();
  const Dataset dataset = DatasetOf(joints, false);
  const ArmSetup setup = SetUpArm(dataset, 0, Kinematics::kAuto);
  EXPECT_EQ(setup.reason.ToString(), "");
  const std::string name = NameOf(*ConfigurationOf(dataset.arms[0]->arm, joints.front()));
  const ArmBranch* right = nullptr;
  for (const ArmBranch& branch : setup.branches) {
    if (branch.name == name) right = &branch;
  }
  ASSERT_NE(right, nullptr);
  ASSERT_EQ(right->joints.size(), joints.size());
  for (size_t i = 0; i < joints.size(); ++i) {
    // The pose is reached to the limit of PostureNear, in m and rad, whether or not it is singular.
    const Rigid3d reached = BaseFromTip(dataset.arms[0]->arm, right->joints[i]) * dataset.arms[0]->tip_from_gripper;
    EXPECT_LT(LocalCoordinates(reached, dataset.captures[i].base_from_gripper[0]).norm(), 2 * kReached);
    const double apart_rad = DistanceRad(right->joints[i], joints[i]);
    EXPECT_TRUE(i == kSingular || apart_rad < 1e-6) << i << ": " << apart_rad;
  }
  const std::vector<SingularCapture> singular = SingularCaptures(dataset.arms[0]->arm, *right);
  ASSERT_EQ(singular.size(), 1U);
  EXPECT_EQ(singular[0].capture, kSingular);
  EXPECT_THAT(singular[0].singularity, HasSubstr("6"));
}

TEST(ArmSetupTest, RegularCaptureIsOutOfReachOfConfigurationsThatItLacks) {
  std::vector<Eigen::VectorXd> joints = JointsWithSingularCapture();
  joints.erase(joints.begin() + kSingular);
  const Dataset dataset = DatasetOf(joints, false);
  const Arm& arm = dataset.arms[0]->arm;
  std::vector<Rigid3d> tips;
  std::vector<std::vector<Eigen::VectorXd>> postures;
  for (const Eigen::VectorXd& of_capture : joints) {
    tips.push_back(BaseFromTip(arm, of_capture));
    postures.push_back(*PosturesOf(arm, tips.back()));
  }
  const size_t num_all = BranchesOf(arm, tips, postures).size();
  postures[2] = {joints[2]};
  const std::vector<ArmBranch> branches = BranchesOf(arm, tips, postures);
  EXPECT_GT(num_all, 1U);
  ASSERT_EQ(branches.size(), num_all);
  for (const ArmBranch& branch : branches) {
    const bool is_of_capture = branch.name == NameOf(*ConfigurationOf(arm, joints[2]));
    EXPECT_EQ(branch.ReachesAll(), is_of_capture);
    EXPECT_EQ(branch.Reaches(2), is_of_capture);
    EXPECT_EQ(branch.joints[2].size(), is_of_capture ? 6 : 0);
  }
}

TEST(ArmSetupTest, ScatterOfTheToolIsExplainedByErrorsOfTheArmOrContradicts) {
  const std::vector<Eigen::VectorXd> joints = JointsWithSingularCapture();
  Dataset dataset = DatasetOf(joints, true);
  // The controller uses the parameters of this very arm.
  Eigen::VectorXd errors = Eigen::VectorXd::Zero(dataset.arms[0]->arm.num_params());
  errors[ArmParamPlace(1, ArmParam::kA)] = 1e-3;
  errors[ArmParamPlace(2, ArmParam::kAlpha)] = 2e-3;
  const Arm own = WithChanges(dataset.arms[0]->arm, errors);
  for (size_t i = 0; i < joints.size(); ++i) {
    dataset.captures[i].base_from_gripper[0] = BaseFromTip(own, joints[i]) * dataset.arms[0]->tip_from_gripper;
  }
  EXPECT_EQ(SetUpArm(dataset, 0, Kinematics::kAuto).reason.ToString(), "");
  // The links of another arm are some millimetres longer.
  errors[ArmParamPlace(1, ArmParam::kA)] = 12e-3;
  errors[ArmParamPlace(3, ArmParam::kD)] = 15e-3;
  dataset.arms[0]->arm = WithChanges(dataset.arms[0]->arm, errors);
  const ArmSetup other = SetUpArm(dataset, 0, Kinematics::kAuto);
  EXPECT_TRUE(IsContradiction(other.reason));
  EXPECT_EQ(other.reason.code, "tool_not_explained");
}

TEST(ArmSetupTest, RecordedSingularCaptureIsNamedToo) {
  const std::vector<Eigen::VectorXd> joints = JointsWithSingularCapture();
  const Dataset dataset = DatasetOf(joints, true);
  const ArmSetup setup = SetUpArm(dataset, 0, Kinematics::kAuto);
  ASSERT_EQ(setup.branches.size(), 1U);
  EXPECT_TRUE(setup.is_recorded);
  const std::vector<SingularCapture> singular = SingularCaptures(dataset.arms[0]->arm, setup.branches[0]);
  ASSERT_EQ(singular.size(), 1U);
  EXPECT_EQ(singular[0].capture, kSingular);
}

TEST(ArmSetupTest, FindingIsDoubtfulOnlyIfRecoveredJointsWereUsed) {
  struct Case {
    bool records_joints;
    bool is_estimated;
    Grade grade;
  };
  for (const Case& one :
       {Case{true, true, Grade::kGood}, {false, false, Grade::kGood}, {false, true, Grade::kDoubtful}}) {
    const std::vector<Eigen::VectorXd> joints = JointsWithSingularCapture();
    const Dataset dataset = DatasetOf(joints, one.records_joints);
    ArmSetup setup = SetUpArm(dataset, 0, Kinematics::kAuto);
    const std::string name =
        one.records_joints ? "recorded" : NameOf(*ConfigurationOf(dataset.arms[0]->arm, joints.front()));
    std::erase_if(setup.branches, [&](const ArmBranch& branch) { return branch.name != name; });
    const std::optional<Finding> finding = FindSingularCaptures(dataset, 0, setup, one.is_estimated);
    ASSERT_TRUE(finding.has_value());
    EXPECT_EQ(finding->grade, one.grade);
    EXPECT_EQ(finding->code, "arm_singular_captures");
    EXPECT_THAT(FindingWords(*finding).text, HasSubstr("in 1 of 8 captures (3.png;"));
  }
}

TEST(ArmSetupTest, MissingJointsHaveNoEffect) {
  const std::vector<Eigen::VectorXd> joints = JointsWithSingularCapture();
  const Dataset dataset = DatasetOf(joints, true);
  ArmBranch branch = SetUpArm(dataset, 0, Kinematics::kAuto).branches[0];
  EXPECT_THAT(SingularCaptures(dataset.arms[0]->arm, {branch.name, {joints[0]}}), IsEmpty());
  branch.joints[1] = Eigen::VectorXd();
  const auto effects = EffectsOf(dataset.arms[0]->arm, dataset.arms[0]->tip_from_gripper, branch);
  EXPECT_EQ(effects[1], nullptr);
  EXPECT_NE(effects[0], nullptr);
  EXPECT_EQ(SingularCaptures(dataset.arms[0]->arm, branch)[0].capture, 1U);
}

TEST(ArmSetupTest, GivenConfigurationThatDoesNotReachTheFirstPoseIsRefused) {
  std::vector<Eigen::VectorXd> joints = JointsWithSingularCapture();
  joints.erase(joints.begin() + kSingular);
  // The arm is nearly stretched, which only one sign of the wrist allows.
  joints.front() << 0.3, -0.6, 0.03, 0, -1.4, 0.2;
  Dataset dataset = DatasetOf(joints, false);
  EXPECT_EQ(SetUpArm(dataset, 0, Kinematics::kAuto).reason.ToString(), "");
  dataset.arms[0]->joints_near = joints[1];
  dataset.arms[0]->joints_near[4] *= -1;
  const ArmSetup setup = SetUpArm(dataset, 0, Kinematics::kAuto);
  EXPECT_EQ(setup.reason.code, "near_out_of_reach");
}

TEST(ArmSetupTest, FewJointsThatContradictTheirPosesAreFound) {
  const std::vector<Eigen::VectorXd> joints = JointsWithSingularCapture();
  Dataset dataset = DatasetOf(joints, true);
  EXPECT_TRUE(FindContradictingJoints(dataset, 0).empty());
  dataset.captures[5].joints[0][1] = 1e9;
  std::swap(dataset.captures[0].joints, dataset.captures[1].joints);
  // Three of eight are too many to know which are right.
  EXPECT_TRUE(FindContradictingJoints(dataset, 0).empty());
  std::swap(dataset.captures[0].joints, dataset.captures[1].joints);
  const std::vector<ContradictingJoints> found = FindContradictingJoints(dataset, 0);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].capture, 5U);
  EXPECT_GT(found[0].apart_m, kMostToolScatterM);
}

}  // namespace
}  // namespace heba
