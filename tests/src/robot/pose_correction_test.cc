#include "heba/evaluation/pose_correction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "heba/robot/arm_postures.h"
#include "heba/robot/arm_table.h"
#include "heba/simulation/arm_captures.h"

namespace heba {
namespace {

RobotSummary CalibratedArm(const Eigen::VectorXd& joints) {
  Rng rng(4);
  RobotSummary robot;
  robot.nominal = *FindArm("ur5e");
  robot.tip_from_gripper = Rigid3d(ExpRotation({0.1, 0.2, 0.3}), {0, 0.02, 0.15});
  robot.is_estimated = true;
  robot.errors = DrawArmErrors(robot.nominal, {DegToRad(0.1), 0.5e-3, DegToRad(0.05)}, rng);
  robot.configuration = NameOf(*ConfigurationOf(robot.nominal, joints));
  return robot;
}

Eigen::VectorXd Joints() {
  Eigen::VectorXd joints(6);
  joints << 0.3, -1.2, 1.4, -1.1, -1.3, 0.5;
  return joints;
}

TEST(PoseCorrectionTest, TruePoseIsThatOfTheArmWithItsErrors) {
  const RobotSummary robot = CalibratedArm(Joints());
  const Rigid3d reported = BaseFromGripper(robot.nominal, Joints(), robot.tip_from_gripper);
  const Rigid3d actual = BaseFromGripper(WithChanges(robot.nominal, robot.errors), Joints(), robot.tip_from_gripper);
  const Outcome<Rigid3d> found = TruePose(robot, reported);
  ASSERT_TRUE(found.ok()) << found.reason();
  EXPECT_LT(LocalCoordinates(actual, *found).norm(), 1e-9);
  EXPECT_GT(DistanceM(reported, *found), 0.1e-3);
}

TEST(PoseCorrectionTest, CommandReachesTheWantedPose) {
  const RobotSummary robot = CalibratedArm(Joints());
  const Rigid3d wanted = BaseFromGripper(robot.nominal, Joints(), robot.tip_from_gripper);
  const Outcome<Rigid3d> command = CommandFor(robot, wanted);
  ASSERT_TRUE(command.ok()) << command.reason();
  EXPECT_LT(LocalCoordinates(wanted, *TruePose(robot, *command)).norm(), 1e-9);
}

TEST(PoseCorrectionTest, PosesThatDoNotTellTheJointsAreRefused) {
  RobotSummary robot = CalibratedArm(Joints());
  const Rigid3d reported = BaseFromGripper(robot.nominal, Joints(), robot.tip_from_gripper);
  EXPECT_THAT(TruePose(robot, {Eigen::Quaterniond::Identity(), {3, 0, 0}}).reason(),
              testing::HasSubstr("out of reach"));
  robot.configuration = "";
  EXPECT_THAT(TruePose(robot, reported).reason(), testing::HasSubstr("several configurations"));
}

// An arm of seven joints has no configurations with names, and an estimate from several ones has none either.
TEST(PoseCorrectionTest, GivenJointsReplaceTheConfiguration) {
  for (const char* name : {"ur5e", "franka_fr3"}) {
    Rng rng(6);
    RobotSummary robot = CalibratedArm(Joints());
    robot.nominal = *FindArm(name);
    robot.errors = DrawArmErrors(robot.nominal, {DegToRad(0.1), 0.5e-3, DegToRad(0.05)}, rng);
    robot.configuration = "";
    Eigen::VectorXd joints = Eigen::VectorXd::Constant(robot.nominal.num_joints(), 0.4);
    joints.head<6>() = Joints();
    const Rigid3d reported = BaseFromGripper(robot.nominal, joints, robot.tip_from_gripper);
    const Rigid3d actual = BaseFromGripper(WithChanges(robot.nominal, robot.errors), joints, robot.tip_from_gripper);
    const Outcome<Rigid3d> found = TruePose(robot, reported, joints);
    ASSERT_TRUE(found.ok()) << found.reason();
    EXPECT_LT(LocalCoordinates(actual, *found).norm(), 1e-9) << name;
    const Outcome<Rigid3d> command = CommandFor(robot, *found, joints);
    ASSERT_TRUE(command.ok()) << command.reason();
    // An arm of seven joints may reach the command with others than these, which differ by the size of the errors, so
    // that their effects differ by its square.
    EXPECT_LT(LocalCoordinates(reported, *command).norm(), name == std::string("ur5e") ? 1e-9 : 1e-5) << name;
    // Joints near the posture choose it.
    const Eigen::VectorXd near = joints + Eigen::VectorXd::Constant(joints.size(), 0.05);
    const Outcome<Rigid3d> from_near = CommandFor(robot, *found, near);
    ASSERT_TRUE(from_near.ok()) << from_near.reason();
    EXPECT_LT(LocalCoordinates(reported, *from_near).norm(), name == std::string("ur5e") ? 1e-9 : 1e-3) << name;
    EXPECT_THAT(TruePose(robot, reported, RadToDeg(1.0) * joints).reason(),
                testing::HasSubstr("not those of the pose"));
  }
}

}  // namespace
}  // namespace heba
