#include "heba/robot/urdf_arm.h"

#include <gtest/gtest.h>

#include "heba/base/files.h"
#include "heba/base/rng.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/robot/arm_postures.h"
#include "heba/robot/arm_table.h"
#include "heba/robot/ur_kinematics.h"
#include "tests/support/arm_joints.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {

// Returns the URDF of a UR arm with the given Denavit-Hartenberg table. Each joint rotates about the z axis of the
// frame at the end of the previous joint.
std::string UrdfOf(const UrRobot& robot, const std::string& extra = "") {
  const double alphas[] = {kPi / 2, 0, 0, kPi / 2, -kPi / 2, 0};
  const double as[] = {0, robot.a2_m, robot.a3_m, 0, 0, 0};
  const double ds[] = {robot.d1_m, 0, 0, robot.d4_m, robot.d5_m, robot.d6_m};
  std::string text = "<robot name=\"arm\"><link name=\"base\"/>\n";
  // The transform Tz(d) Tx(a) Rx(alpha) of one joint is the origin of the next.
  std::string origin = "0 0 0\" rpy=\"0 0 0";
  std::string parent = "base";
  for (int i = 0; i < 6; ++i) {
    const std::string n = std::to_string(i + 1);
    text +=
        "<link name=\"link" + n + "\"/><joint name=\"j" + n + "\" type=\"revolute\"><parent link=\"" + parent +
        "\"/><child link=\"link" + n + "\"/><origin xyz=\"" + origin +
        "\"/><axis xyz=\"0 0 1\"/><limit lower=\"-3.1416\" upper=\"3.1416\" effort=\"1\" velocity=\"1\"/></joint>\n";
    char next[200];
    std::snprintf(next, sizeof next, "%.17g 0 %.17g\" rpy=\"%.17g 0 0", as[i], ds[i], alphas[i]);
    origin = next;
    parent = "link" + n;
  }
  return text + "<link name=\"flange\"/><joint name=\"end\" type=\"fixed\"><parent link=\"" + parent +
         "\"/><child link=\"flange\"/><origin xyz=\"" + origin + "\"/></joint>\n" + extra + "</robot>\n";
}

class UrdfArmTest : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& text) {
    WriteFileAtomically(folder_ / "arm.urdf", text);
    return folder_ / "arm.urdf";
  }
  std::string ErrorOf(const std::string& text, const std::string& base = "", const std::string& tip = "") {
    const std::filesystem::path file = Write(text);
    return InputErrorOf([&] { ReadUrdfArm(file, base, tip); });
  }
  TempFolder folder_;
};

TEST_F(UrdfArmTest, AgreesWithTheClosedForm) {
  const UrRobot& robot = *FindUrRobot("ur5e");
  const UrdfArm urdf = ReadUrdfArm(Write(UrdfOf(robot)));
  EXPECT_EQ(urdf.joint_names, (std::vector<std::string>{"j1", "j2", "j3", "j4", "j5", "j6"}));
  ASSERT_EQ(urdf.arm.limits.size(), 6U);
  EXPECT_EQ(urdf.arm.limits[2].high, 3.1416);
  Rng rng(3);
  for (int trial = 0; trial < 200; ++trial) {
    JointAngles joints;
    for (double& joint : joints) joint = rng.Uniform(-3, 3);
    const Rigid3d expected = BaseFromFlange(robot, joints);
    const Rigid3d found = BaseFromTip(urdf.arm, Eigen::Map<const Eigen::Matrix<double, 6, 1>>(joints.data()));
    EXPECT_LT(DistanceM(expected, found), 1e-12);
    EXPECT_LT(AngleRad(expected, found), 1e-7);
  }
}

// Returns three random numbers, and adds them to a text.
Eigen::Vector3d AddNumbers(Rng& rng, const char* attribute, std::string& text) {
  const Eigen::Vector3d v{rng.Uniform(-1, 1), rng.Uniform(-1, 1), rng.Uniform(-1, 1)};
  text +=
      std::string(" ") + attribute + "=\"" + RoundTrip(v.x()) + " " + RoundTrip(v.y()) + " " + RoundTrip(v.z()) + "\"";
  return v;
}

// The pose of the tip is the product of the origins and motions of all joints, whatever their axes.
TEST_F(UrdfArmTest, ChainsOfAnyAxesAreTheProductOfTheirJoints) {
  Rng rng(11);
  const std::vector<std::string> types = {"revolute", "fixed", "prismatic", "continuous", "revolute", "prismatic"};
  for (int trial = 0; trial < 20; ++trial) {
    std::string text = "<robot name=\"arm\"><link name=\"link0\"/>\n";
    Rigid3d expected;
    std::vector<double> joints;
    for (size_t j = 0; j < types.size(); ++j) {
      const std::string n = std::to_string(j + 1);
      text += "<link name=\"link" + n + "\"/><joint name=\"j" + n + "\" type=\"" + types[j] + "\"><parent link=\"link" +
              std::to_string(j) + "\"/><child link=\"link" + n + "\"/><origin";
      const Eigen::Vector3d place_m = AddNumbers(rng, "xyz", text);
      const Eigen::Vector3d rpy_rad = AddNumbers(rng, "rpy", text);
      text += "/><axis";
      const Eigen::Vector3d axis = AddNumbers(rng, "xyz", text).normalized();
      text += "/><limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>\n";
      const Eigen::Quaterniond rotation =
          ExpRotation({0, 0, rpy_rad.z()}) * ExpRotation({0, rpy_rad.y(), 0}) * ExpRotation({rpy_rad.x(), 0, 0});
      expected = expected * Rigid3d(rotation, place_m);
      if (types[j] == "fixed") continue;
      const double joint = joints.emplace_back(rng.Uniform(-3, 3));
      const bool is_sliding = types[j] == "prismatic";
      expected = expected * (is_sliding ? Rigid3d(Eigen::Quaterniond::Identity(), joint * axis)
                                        : Rigid3d(ExpRotation(joint * axis), Eigen::Vector3d::Zero()));
    }
    const Arm arm = ReadUrdfArm(Write(text + "</robot>\n")).arm;
    const Rigid3d found = BaseFromTip(arm, Eigen::Map<const Eigen::VectorXd>(joints.data(), arm.num_joints()));
    EXPECT_LT(LocalCoordinates(expected, found).norm(), 1e-9);
  }
}

// Returns an element that states a mass.
std::string Inertial(double mass_kg, const Eigen::Vector3d& centre_m) {
  char text[400];
  std::snprintf(text, sizeof text,
                "<inertial><mass value=\"%.17g\"/><origin xyz=\"%.17g %.17g %.17g\"/><inertia ixx=\"1\" ixy=\"0\" "
                "ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>",
                mass_kg, centre_m.x(), centre_m.y(), centre_m.z());
  return text;
}

// A slide ends at its limits; a joint that turns without an end, and one whose file states no positions, end nowhere.
TEST_F(UrdfArmTest, JointsEndWhereTheFileSays) {
  std::string text = "<robot name=\"arm\"><link name=\"link0\"/>\n";
  const std::string joints[][2] = {{"continuous", ""},
                                   {"prismatic", "<limit lower=\"0\" upper=\"0.8\" effort=\"1\" velocity=\"1\"/>"},
                                   {"revolute", "<limit effort=\"1\" velocity=\"1\"/>"}};
  for (size_t j = 0; j < 3; ++j) {
    const std::string n = std::to_string(j + 1);
    text += "<link name=\"link" + n + "\"/><joint name=\"j" + n + "\" type=\"" + joints[j][0] +
            "\"><parent link=\"link" + std::to_string(j) + "\"/><child link=\"link" + n +
            "\"/><origin xyz=\"0.2 0 0.1\"/><axis xyz=\"0 0 1\"/>" + joints[j][1] + "</joint>\n";
  }
  const Arm arm = ReadUrdfArm(Write(text + "</robot>\n")).arm;
  const Eigen::Vector3d inside(7, 0.5, -5);
  EXPECT_EQ(WithinLimits(arm, inside), Eigen::VectorXd(inside));
  for (const double beyond : {-0.1, 0.9, 0.5 + 2 * kPi}) {
    EXPECT_FALSE(WithinLimits(arm, Eigen::Vector3d(7, beyond, -5)).has_value()) << beyond;
  }
}

TEST_F(UrdfArmTest, ChainsOfTooManyJointsAreRefused) {
  std::string text = "<robot name=\"arm\"><link name=\"link0\"/>\n";
  for (int j = 0; j < 101; ++j) {
    const std::string n = std::to_string(j + 1);
    text += "<link name=\"link" + n + "\"/><joint name=\"j" + n + "\" type=\"continuous\"><parent link=\"link" +
            std::to_string(j) + "\"/><child link=\"link" + n + "\"/><axis xyz=\"0 0 1\"/></joint>\n";
  }
  EXPECT_NE(InputErrorOf([&] { ReadUrdfArm(Write(text + "</robot>\n")); }).find("101 joints move"), std::string::npos);
}

// The masses of the links, of the flange and of a finger beside the chain.
TEST_F(UrdfArmTest, MassesAreThoseOfItsLinks) {
  const Arm& table = *FindArm("ur5e");
  std::string text = UrdfOf(*FindUrRobot("ur5e"),
                            "<link name=\"finger\">" + Inertial(0.5, {0.01, 0.02, 0.03}) +
                                "</link><joint name=\"grip\" type=\"prismatic\"><parent link=\"flange\"/><child "
                                "link=\"finger\"/><origin xyz=\"0 0 0.1\"/><axis xyz=\"1 0 0\"/><limit lower=\"0\" "
                                "upper=\"0.1\" effort=\"1\" velocity=\"1\"/></joint>");
  for (size_t j = 0; j < 6; ++j) {
    // A link of the file has its frame on its joint, before d, a and alpha.
    Arm link;
    link.joints = {table.joints[j]};
    const PointMass& mass = table.load->links[j];
    const std::string name = "<link name=\"link" + std::to_string(j + 1) + "\"";
    text.replace(
        text.find(name + "/>"), name.size() + 2,
        name + ">" + Inertial(mass.mass_kg, BaseFromTip(link, Eigen::VectorXd::Zero(1)) * mass.centre_m) + "</link>");
  }
  const std::string flange = "<link name=\"flange\"";
  text.replace(text.find(flange + "/>"), flange.size() + 2, flange + ">" + Inertial(1.5, {0, 0.05, 0}) + "</link>");
  const Arm loaded = WithPayload(WithPayload(table, {1.5, {0, 0.05, 0}}), {0.5, {0.01, 0.02, 0.13}});
  const Arm found = ReadUrdfArm(Write(text), "base", "flange").arm;
  ASSERT_NE(found.load, nullptr);
  Rng rng(7);
  for (int trial = 0; trial < 10; ++trial) {
    const Eigen::VectorXd joints = RandomJoints(table, rng);
    EXPECT_LT((GravityTorques(found, joints) - GravityTorques(loaded, joints)).norm(), 1e-9);
  }
  EXPECT_EQ(ReadUrdfArm(Write(UrdfOf(*FindUrRobot("ur5e")))).arm.load, nullptr);
  text.replace(text.find("mass value=\""), 12, "mass value=\"-");
  EXPECT_EQ(ErrorOf(text, "base", "flange"),
            (folder_.path() / "arm.urdf").string() + ": link 'link1' has an impossible mass or centre of mass");
}

TEST_F(UrdfArmTest, FaultsSayWhatIsWrong) {
  const std::string good = UrdfOf(*FindUrRobot("ur5"));
  const std::string branch =
      "<link name=\"camera\"/><joint name=\"mount\" type=\"fixed\"><parent link=\"link3\"/><child "
      "link=\"camera\"/></joint>";
  EXPECT_NE(ErrorOf("<robot").find("not a URDF"), std::string::npos);
  EXPECT_NE(ErrorOf("<xacro/>").find("not a URDF"), std::string::npos);
  EXPECT_NE(ErrorOf(good, "", "flang").find("did you mean 'flange'"), std::string::npos);
  EXPECT_NE(ErrorOf(good, "link4", "link2").find("is not connected to"), std::string::npos);
  EXPECT_NE(ErrorOf(good, "link6", "flange").find("no joint moves"), std::string::npos);
  EXPECT_NE(ErrorOf(UrdfOf(*FindUrRobot("ur5"), branch)).find("name the flange (tip_link), one of: camera, flange"),
            std::string::npos);
  EXPECT_EQ(ErrorOf(UrdfOf(*FindUrRobot("ur5"), branch), "", "flange"), "no error");
  const std::string loop =
      "<link name=\"a\"/><link name=\"b\"/>"
      "<joint name=\"ab\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>"
      "<joint name=\"ba\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint>";
  EXPECT_NE(ErrorOf(UrdfOf(*FindUrRobot("ur5"), loop), "", "b").find("form a loop"), std::string::npos);
}

}  // namespace
}  // namespace heba
