#include "heba/io/arm_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "heba/base/units.h"
#include "heba/io/export.h"
#include "heba/robot/arm_table.h"
#include "heba/robot/urdf_arm.h"
#include "heba/simulation/arm_captures.h"
#include "tests/support/arm_joints.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {

// The nominal parameters as ROS' ur_description has them.
constexpr const char* kNominalUr5e = R"(kinematics:
  shoulder: {x: 0, y: 0, z: 0.1625, roll: 0, pitch: 0, yaw: 0}
  upper_arm: {x: 0, y: 0, z: 0, roll: 1.570796326794897, pitch: 0, yaw: 0}
  forearm: {x: -0.425, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}
  wrist_1: {x: -0.3922, y: 0, z: 0.1333, roll: 0, pitch: 0, yaw: 0}
  wrist_2: {x: 0, y: -0.0997, z: 0, roll: 1.570796326794897, pitch: 0, yaw: 0}
  wrist_3: {x: 0, y: 0.0996, z: 0, roll: 1.570796326589793, pitch: 3.141592653589793, yaw: 3.141592653589793}
)";

TEST(ArmFileTest, ReadsTheFileOfRos) {
  const TempFolder folder;
  WriteFileAtomically(folder.path() / "ur5e.yaml", kNominalUr5e);
  const Arm& nominal = *FindArm("ur5e");
  const Arm read = ReadArmFile(folder.path() / "ur5e.yaml", nominal);
  EXPECT_EQ(read.limits.size(), 6U);
  Rng rng(2);
  for (int i = 0; i < 10; ++i) {
    const Eigen::VectorXd joints = RandomJoints(nominal, rng);
    EXPECT_LT(LocalCoordinates(BaseFromTip(nominal, joints), BaseFromTip(read, joints)).norm(), 1e-8);
  }
}

TEST(ArmFileTest, ReadsWhatItWrites) {
  const TempFolder folder;
  Rng rng(3);
  const Arm& nominal = *FindArm("ur10e");
  const Arm arm = WithChanges(nominal, DrawArmErrors(nominal, {DegToRad(0.2), 1e-3, DegToRad(0.1)}, rng));
  const Outcome<std::string> text = ArmFileText(arm);
  ASSERT_TRUE(text.ok()) << text.reason();
  WriteFileAtomically(folder.path() / "arm.yaml", *text);
  const Arm read = ReadArmFile(folder.path() / "arm.yaml", nominal);
  for (int i = 0; i < 10; ++i) {
    const Eigen::VectorXd joints = RandomJoints(nominal, rng);
    EXPECT_LT(LocalCoordinates(BaseFromTip(arm, joints), BaseFromTip(read, joints)).norm(), 1e-10);
  }
}

TEST(ArmFileTest, OtherArmsAreRefused) {
  EXPECT_THAT(ArmFileText(*FindArm("franka_fr3")).reason(), testing::HasSubstr("six joints"));
}

// The exported URDF, read by another library, has the same kinematics.
TEST(ArmFileTest, ExportedUrdfIsTheSameArm) {
  const TempFolder folder;
  Rng rng(5);
  for (const char* name : {"ur5e", "franka_fr3", "kuka_kr6_r900"}) {
    const Arm& nominal = *FindArm(name);
    ExportRequest request;
    request.name = "cell";
    request.arm = WithChanges(nominal, DrawArmErrors(nominal, {DegToRad(0.2), 1e-3, DegToRad(0.1)}, rng));
    for (const ExportFormat& format : ExportFormats()) {
      if (format.name != "robot_urdf") continue;
      const Outcome<std::string> text = ExportText(format, request);
      ASSERT_TRUE(text.ok()) << text.reason();
      WriteFileAtomically(folder.path() / "robot.urdf", *text);
    }
    const Arm again = ReadUrdfArm(folder.path() / "robot.urdf").arm;
    for (int i = 0; i < 5; ++i) {
      const Eigen::VectorXd joints = RandomJoints(nominal, rng);
      const Rigid3d pose = BaseFromTip(*request.arm, joints);
      EXPECT_LT(LocalCoordinates(pose, BaseFromTip(again, joints)).norm(), 1e-9) << name;
    }
  }
}

}  // namespace
}  // namespace heba
