#include <cmath>
#include <fstream>
#include <limits>
#include <string>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/io/pose_file.h"
#include "heba/io/pose_formats.h"
#include "heba/robot/ur_kinematics.h"
#include "tests/support/data_sets.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

// rad and m: rounding for poses within a few metres.
constexpr double kRoundOff = 1e-13;

Eigen::Matrix3d Rx(double angle_deg) {
  return Eigen::AngleAxisd(DegToRad(angle_deg), Eigen::Vector3d::UnitX()).toRotationMatrix();
}
Eigen::Matrix3d Ry(double angle_deg) {
  return Eigen::AngleAxisd(DegToRad(angle_deg), Eigen::Vector3d::UnitY()).toRotationMatrix();
}
Eigen::Matrix3d Rz(double angle_deg) {
  return Eigen::AngleAxisd(DegToRad(angle_deg), Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

// Returns the rotations by multiples of 90 deg about z, y and x in turn, up to half a turn either way.
std::vector<Eigen::Matrix3d> QuarterRotations() {
  std::vector<Eigen::Matrix3d> rotations;
  for (int a = -2; a <= 2; ++a) {
    for (int b = -2; b <= 2; ++b) {
      for (int c = -2; c <= 2; ++c) rotations.push_back(Rz(90 * a) * Ry(90 * b) * Rx(90 * c));
    }
  }
  return rotations;
}

PoseFormat Format(const std::string& name) { return *FindPoseFormat(name); }
PoseFormat FormatOf(const std::string& yaml) {
  return ReadPoseFormat(MapReader(ParseYaml("pose_format: " + yaml, "cell.yaml")).Get("pose_format"));
}
// Returns a user-defined format with the rotation `name`.
PoseFormat FormatOfRotation(const std::string& name) {
  PoseFormat format = {"", {"x", "y", "z"}, "mm", name, ""};
  const bool quaternion = name.starts_with("quaternion");
  const int num_numbers = name == "matrix" ? 9 : quaternion ? 4 : 3;
  for (int i = 0; i < num_numbers; ++i) format.columns.push_back("r" + std::to_string(i));
  if (name != "matrix" && !quaternion) format.angle_unit = "deg";
  return format;
}

// Expects that `numbers` are a pose with the translation (0.1, 0.2, 0.3) m, given as 100, 200, 300 mm or 0.1, 0.2,
// 0.3 m, and with the given rotation.
void ExpectPose(const std::string& format, const std::vector<double>& numbers, const Eigen::Matrix3d& rotation) {
  const Outcome<Rigid3d> pose = PoseFromNumbers(Format(format), numbers);
  ASSERT_TRUE(pose.ok()) << format << ": " << pose.reason();
  EXPECT_LT((pose->translation - Eigen::Vector3d(0.1, 0.2, 0.3)).norm(), kRoundOff) << format;
  EXPECT_LT((pose->RotationMatrix() - rotation).norm(), kRoundOff) << format;
}

// These examples pin the conventions of the robots' controllers.
TEST(PoseFormatTest, FollowsEveryRobotsConvention) {
  const double s = std::sqrt(0.5);
  ExpectPose("ros", {0.1, 0.2, 0.3, s, 0, 0, s}, Rx(90));
  ExpectPose("abb", {100, 200, 300, s, 0, 0, s}, Rz(90));
  ExpectPose("ur", {0.1, 0.2, 0.3, 0, kPi / 2, 0}, Ry(90));
  ExpectPose("kuka", {100, 200, 300, 10, 20, 30}, Rz(10) * Ry(20) * Rx(30));
  ExpectPose("fanuc", {100, 200, 300, 10, 20, 30}, Rz(30) * Ry(20) * Rx(10));
  ExpectPose("yaskawa", {100, 200, 300, 10, 20, 30}, Rz(30) * Ry(20) * Rx(10));
  ExpectPose("staubli", {100, 200, 300, 10, 20, 30}, Rx(10) * Ry(20) * Rz(30));
  ExpectPose("doosan", {100, 200, 300, 10, 20, 30}, Rz(10) * Ry(20) * Rz(30));
  ExpectPose("techman", {100, 200, 300, 10, 20, 30}, Rz(30) * Ry(20) * Rx(10));
  ExpectPose("kawasaki", {100, 200, 300, 10, 20, 30}, Rz(10) * Ry(20) * Rz(30));
  ExpectPose("matrix", {0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1}, Rz(90));
}

// Franka's O_T_EE is written column by column.
TEST(PoseFormatTest, AMatrixByColumnsIsRecognised) {
  ExpectPose("matrix", {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0.1, 0.2, 0.3, 1}, Rz(90));
}

TEST(PoseFormatTest, BuiltInFormatsMatchTheManual) {
  EXPECT_THAT(PoseFormatNames(), ElementsAre("ros", "ur", "kuka", "fanuc", "yaskawa", "abb", "doosan", "techman",
                                             "staubli", "kawasaki", "matrix"));
  EXPECT_THAT(Format("abb").columns, ElementsAre("x", "y", "z", "q1", "q2", "q3", "q4"));
  EXPECT_EQ(Format("matrix").columns.size(), 16u);
  EXPECT_EQ(Format("matrix").columns[4], "m10");
  EXPECT_EQ(FindPoseFormat("kuka2"), nullptr);
  // Four representations without an order of axes, and 3 x 2 x 2 x 2 Euler conventions.
  EXPECT_EQ(PoseRotationNames().size(), 4u + 24u);
}

class RotationTest : public testing::TestWithParam<std::string> {};

TEST_P(RotationTest, NumbersAndPosesRoundTrip) {
  Rng rng(1);
  const PoseFormat format = FormatOfRotation(GetParam());
  for (int i = 0; i < 200; ++i) {
    const double angle_rad = rng.Uniform(0, kPi);
    const Eigen::Vector3d axis = rng.Direction3();
    const Rigid3d pose(ExpRotation(angle_rad * axis), rng.NormalVector3());
    const Outcome<Rigid3d> read = PoseFromNumbers(format, NumbersFromPose(format, pose));
    ASSERT_TRUE(read.ok()) << read.reason();
    EXPECT_NEAR(AngleRad(*read, pose), 0, kRoundOff);
    EXPECT_NEAR(DistanceM(*read, pose), 0, kRoundOff);
  }
}

// Angle between a rotation and the multiple of 90 deg next to it.
struct Miss {
  const char* name;
  double angle_rad;
};
void PrintTo(const Miss& miss, std::ostream* stream) { *stream << miss.name; }

class NearlyLockedRotationTest : public testing::TestWithParam<std::tuple<std::string, Miss>> {};

// Euler angles are singular at some of the multiples of 90 deg; the rotations are exactly there or miss them by a
// small angle.
TEST_P(NearlyLockedRotationTest, RoundTrips) {
  Rng rng(2);
  const PoseFormat format = FormatOfRotation(std::get<std::string>(GetParam()));
  const double miss_rad = std::get<Miss>(GetParam()).angle_rad;
  for (const Eigen::Matrix3d& locked : QuarterRotations()) {
    const Eigen::Vector3d axis = rng.Direction3();
    const Rigid3d pose(Eigen::Quaterniond(locked) * ExpRotation(miss_rad * axis), {1, 2, 3});
    const Outcome<Rigid3d> read = PoseFromNumbers(format, NumbersFromPose(format, pose));
    ASSERT_TRUE(read.ok()) << read.reason();
    EXPECT_NEAR(AngleRad(*read, pose), 0, kRoundOff) << "near\n" << locked.array().round();
  }
}

std::vector<std::string> NamesWithAnOrder() {
  std::vector<std::string> names;
  for (const std::string& name : PoseRotationNames()) {
    if (name.starts_with("euler_") || name.starts_with("extrinsic_")) names.push_back(name);
  }
  return names;
}
class OrderOfAxesTest : public testing::TestWithParam<std::string> {};

TEST_P(OrderOfAxesTest, IsTheOrderOfTheProduct) {
  const std::string& name = GetParam();
  const std::string order = name.substr(name.find('_') + 1);
  const auto turn = [](char axis, double angle_deg) {
    return axis == 'x' ? Rx(angle_deg) : axis == 'y' ? Ry(angle_deg) : Rz(angle_deg);
  };
  const Eigen::Matrix3d first = turn(order[0], 10);
  const Eigen::Matrix3d second = turn(order[1], 20);
  const Eigen::Matrix3d third = turn(order[2], 30);
  const Outcome<Rigid3d> pose = PoseFromNumbers(FormatOfRotation(name), std::vector<double>{100, 200, 300, 10, 20, 30});
  ASSERT_TRUE(pose.ok());
  const bool turning_axes = name.starts_with("euler_");
  const Eigen::Matrix3d expected = turning_axes ? Eigen::Matrix3d(first * second * third) : third * second * first;
  EXPECT_LT((pose->RotationMatrix() - expected).norm(), kRoundOff);
  // Far from gimbal lock the angles themselves are recovered.
  const std::vector<double> numbers = NumbersFromPose(FormatOfRotation(name), *pose);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(numbers[static_cast<size_t>(3 + i)], 10 * (i + 1), 1e-10);  // deg
}

std::string NameOf(const testing::TestParamInfo<std::string>& parameter) { return parameter.param; }
INSTANTIATE_TEST_SUITE_P(Names, RotationTest, testing::ValuesIn(PoseRotationNames()), NameOf);
INSTANTIATE_TEST_SUITE_P(Names, OrderOfAxesTest, testing::ValuesIn(NamesWithAnOrder()), NameOf);
INSTANTIATE_TEST_SUITE_P(
    NamesAndMisses, NearlyLockedRotationTest,
    testing::Combine(testing::ValuesIn(PoseRotationNames()),
                     testing::Values(Miss{"exact", 0}, Miss{"femtoradian", 1e-15}, Miss{"picoradian", 1e-12},
                                     Miss{"nanoradian", 1e-9}, Miss{"microradian", 1e-6}, Miss{"milliradian", 1e-3})),
    [](const auto& test) { return std::get<std::string>(test.param) + "_" + std::get<Miss>(test.param).name; });

TEST(PoseFromNumbersTest, NormalisesRoundedRotations) {
  // Three decimals change the norm by up to 0.001.
  const Outcome<Rigid3d> pose =
      PoseFromNumbers(Format("ros"), std::vector<double>{0, 0, 0, 0.183, -0.365, 0.548, 0.730});
  ASSERT_TRUE(pose.ok());
  EXPECT_NEAR(pose->rotation.norm(), 1, 1e-15);
  const Outcome<Rigid3d> matrix = PoseFromNumbers(
      Format("matrix"), std::vector<double>{0.866, -0.5, 0, 1, 0.5, 0.866, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1});
  ASSERT_TRUE(matrix.ok());
  EXPECT_NEAR(matrix->rotation.norm(), 1, 1e-15);
  EXPECT_LT((matrix->RotationMatrix() - Rz(30)).norm(), 1e-4);  // Rounding of cos(30 deg) to 0.866.
}

TEST(PoseFromNumbersTest, RefusesInvalidPoses) {
  const auto reason = [](const std::string& format, const std::vector<double>& numbers) {
    return PoseFromNumbers(Format(format), numbers).reason();
  };
  EXPECT_THAT(reason("ros", {0, 0, 0, 0, 0, 0, 0}), HasSubstr("the quaternion's length is 0, not 1"));
  EXPECT_THAT(reason("abb", {0, 0, 0, 0.9, 0, 0, 0.4}), HasSubstr("length is 0.9849, not 1"));
  EXPECT_THAT(reason("ros", {0, std::nan(""), 0, 0, 0, 0, 1}), HasSubstr("'y' is not finite"));
  EXPECT_THAT(reason("ur", {0, 0, 0, 0, 1e300, 0}), HasSubstr("'ry' is larger than any robot's"));
  EXPECT_THAT(reason("matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1}), HasSubstr("reflection"));
  EXPECT_THAT(reason("matrix", {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1}), HasSubstr("not a rotation"));
  // The matrix is written column by column.
  EXPECT_THAT(reason("matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.1, 0.2, 0.3, 2}), HasSubstr("not 0 0 0 1"));
}

// User-defined formats.

TEST(ReadPoseFormatTest, ReadsNamesAndMappings) {
  EXPECT_EQ(FormatOf("kuka").rotation, "euler_zyx");
  const PoseFormat format =
      FormatOf("{columns: [X, Y, Z, Rx, Ry, Rz], translation: mm, rotation: extrinsic_xyz, angle: deg}");
  EXPECT_THAT(format.columns, ElementsAre("X", "Y", "Z", "Rx", "Ry", "Rz"));
  const Outcome<Rigid3d> pose = PoseFromNumbers(format, std::vector<double>{1, 2, 3, 10, 20, 30});
  ASSERT_TRUE(pose.ok());
  EXPECT_LT((pose->RotationMatrix() - Rz(30) * Ry(20) * Rx(10)).norm(), kRoundOff);
  EXPECT_LT((pose->translation - Eigen::Vector3d(0.001, 0.002, 0.003)).norm(), kRoundOff);

  const PoseFormat twelve =
      FormatOf("{columns: [x, y, z, a, b, c, d, e, f, g, h, i], translation: m, rotation: matrix}");
  const Outcome<Rigid3d> turned = PoseFromNumbers(twelve, std::vector<double>{1, 2, 3, 0, -1, 0, 1, 0, 0, 0, 0, 1});
  ASSERT_TRUE(turned.ok());
  EXPECT_LT((turned->RotationMatrix() - Rz(90)).norm(), kRoundOff);
}

TEST(ReadPoseFormatTest, NodesRoundTrip) {
  for (const std::string& rotation : PoseRotationNames()) {
    const PoseFormat format = FormatOfRotation(rotation);
    std::stringstream text;
    text << YAML::Dump(PoseFormatNode(format));
    const PoseFormat read = ReadPoseFormat(ParseYaml(text.str(), "cell.yaml"));
    EXPECT_EQ(read.columns, format.columns);
    EXPECT_EQ(read.rotation, format.rotation);
    EXPECT_EQ(read.translation_unit, format.translation_unit);
    EXPECT_EQ(read.angle_unit, format.angle_unit);
  }
  EXPECT_EQ(PoseFormatNode(Format("fanuc")).Scalar(), "fanuc");
}

TEST(ReadPoseFormatTest, TextsRoundTrip) {
  PoseFormat format = {"", {"x'", "y [mm]", "z: '", "a", "b,c", "#d"}, "mm", "euler_zyx", "deg"};
  EXPECT_EQ(FormatOf(PoseFormatText(format)).columns, format.columns);
  format.columns = {"X", "Y", "Z", "rot_z", "rot-y", "r1"};
  EXPECT_EQ(PoseFormatText(format),
            "{columns: [X, Y, Z, rot_z, rot-y, r1], translation: mm, rotation: euler_zyx, angle: deg}");
}

TEST(ReadPoseFormatTest, SaysWhatIsWrong) {
  const auto error = [](const std::string& yaml) { return InputErrorOf([&] { FormatOf(yaml); }); };
  EXPECT_THAT(error("kuke"),
              HasSubstr("cell.yaml:1: pose_format: 'kuke' is unknown; did you mean 'kuka'? One of: ros, ur, kuka"));
  EXPECT_THAT(error("kuke"), HasSubstr("did you mean 'kuka'?"));
  EXPECT_THAT(error("[ros]"), HasSubstr("one of: ros"));
  EXPECT_THAT(error("{columns: [x, y, z, a, b, c], translation: mm, rotation: euler_zyz}"),
              HasSubstr("'angle' is missing"));
  EXPECT_THAT(error("{columns: [x, y, z, a, b, c], rotation: euler_zyz, angle: deg}"),
              HasSubstr("'translation' is missing"));
  EXPECT_THAT(error("{columns: [x, y, z, a, b, c], translation: mm, rotation: euler_zzy, angle: deg}"),
              HasSubstr("'euler_zzy' is unknown"));
  EXPECT_THAT(error("{columns: [x, y, z, a, b], translation: mm, rotation: euler_zyx, angle: deg}"),
              HasSubstr("5 columns of numbers; euler_zyx needs 6"));
  EXPECT_THAT(error("{columns: [x, y, z, a, b, b], translation: mm, rotation: euler_zyx, angle: deg}"),
              HasSubstr("twice"));
  EXPECT_THAT(error("{columns: [x, y, z, a, b, image], translation: mm, rotation: euler_zyx, angle: deg}"),
              HasSubstr("5 columns of numbers; euler_zyx needs 6"));
  EXPECT_THAT(error("{columns: [x, y, z, a, b, c, d], translation: mm, rotation: quaternion_xyzw, angle: deg}"),
              HasSubstr("has no angles"));
  EXPECT_THAT(error("{columns: [x, y, z, a, b, c, d], translation: mm, rotation: quaternion_xyzw, unit: deg}"),
              HasSubstr("unknown key 'unit'"));
}

TEST(WithUnitsTest, OnlyMatricesAcceptOtherUnits) {
  const ConfigValue mm = MapReader(ParseYaml("units: mm", "cell.yaml")).Get("units");
  const PoseFormat format = WithUnits(Format("matrix"), mm);
  const Outcome<Rigid3d> pose =
      PoseFromNumbers(format, std::vector<double>{1, 0, 0, 10, 0, 1, 0, 20, 0, 0, 1, 30, 0, 0, 0, 1});
  ASSERT_TRUE(pose.ok());
  EXPECT_LT((pose->translation - Eigen::Vector3d(0.01, 0.02, 0.03)).norm(), kRoundOff);
  EXPECT_THAT(InputErrorOf([&] { WithUnits(Format("ros"), mm); }), HasSubstr("pose format 'ros' is always in m"));
}

// poses.csv.

std::vector<PoseRow> Parse(const std::string& text, const std::string& format = "ros") {
  return ParsePoses(text, "poses.csv", Format(format));
}
std::string ErrorOf(const std::string& text, const std::string& format = "ros") {
  return InputErrorOf([&] { Parse(text, format); });
}
const std::string kHeader = "image,x,y,z,qx,qy,qz,qw\n";

TEST(PoseFileTest, ReadsRowsInTheFilesOrder) {
  const std::vector<PoseRow> rows = Parse(
      "image,role,x,y,z,qx,qy,qz,qw\n"
      "b.png,home,1,2,3,0,0,0,1\n"
      "a.png,,4,5,6,1,0,0,0\n");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].image, "b.png");
  EXPECT_EQ(rows[0].role, CaptureRole::kHome);
  EXPECT_EQ(rows[0].line, 2);
  EXPECT_EQ(rows[0].pose.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(rows[1].image, "a.png");
  EXPECT_EQ(rows[1].role, CaptureRole::kNone);
  EXPECT_NEAR(RotationAngle(rows[1].pose.rotation), kPi, kRoundOff);
}

TEST(PoseFileTest, AcceptsColumnsInAnyOrderWithoutImages) {
  const std::vector<PoseRow> rows = Parse("qw,qx,qy,qz,z,y,x\n1,0,0,0,3,2,1\n");
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].image, "");
  EXPECT_EQ(rows[0].pose.translation, Eigen::Vector3d(1, 2, 3));
}

// The same content in the variants that different programs write.
TEST(PoseFileTest, ReadsVariantsOfOtherPrograms) {
  const std::vector<std::string> texts = {
      "image,x,y,z,qx,qy,qz,qw\na b.png,1,-2.5e-1,3,0,0,0,1\n",
      "image,x,y,z,qx,qy,qz,qw\na b.png,1,-2.5e-1,3,0,0,0,1",
      "\xEF\xBB\xBFimage,x,y,z,qx,qy,qz,qw\r\na b.png,1,-.25,3,0,0,0,1\r\n",
      "image;x;y;z;qx;qy;qz;qw\na b.png;1;-0.25;3;0;0;0;1\n",
      "image\tx\ty\tz\tqx\tqy\tqz\tqw\na b.png\t1\t-0.25\t3\t0\t0\t0\t1\n",
      " image ,\tx , y , z , qx , qy , qz , qw \n  a b.png , 1 , -0.25 , +3 , 0 , 0 , 0 , 1.\n",
      "\"image\",\"x\",\"y\",\"z\",\"qx\",\"qy\",\"qz\",\"qw\"\n\"a b.png\",\"1\",\"-0.25\",3,0,0,0,1\n",
      "# made by a program\n\nimage,x,y,z,qx,qy,qz,qw\n\n  # the first\n  \t\na b.png,1,-0.25,3,0,0,0,1\n\n"};
  for (const std::string& text : texts) {
    const std::vector<PoseRow> rows = Parse(text);
    ASSERT_EQ(rows.size(), 1u) << text;
    EXPECT_EQ(rows[0].image, "a b.png");
    EXPECT_EQ(rows[0].pose.translation, Eigen::Vector3d(1, -0.25, 3));
    EXPECT_EQ(rows[0].pose.rotation.w(), 1);
  }
  EXPECT_EQ(Parse(texts.back())[0].line, 7);
}

TEST(PoseFileTest, QuotesProtectSeparators) {
  const std::vector<PoseRow> rows = Parse(kHeader + "\"a, \"\"b\"\".png\",1,2,3,0,0,0,1\n");
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].image, "a, \"b\".png");
}

// Recordings that have no images call the names of their captures so.
TEST(PoseFileTest, SeparatorsAtTheEndOfALineWithoutAHeaderAreNoFields) {
  EXPECT_EQ(WithoutBrackets("1, 2 ,; ,"), "1, 2");
  // A million of them cost no more than reading them once.
  EXPECT_EQ(WithoutBrackets("1, 2" + std::string(1 << 20, ',')), "1, 2");
  EXPECT_EQ(WithoutBrackets(",;"), "");
}

TEST(PoseFileTest, PosesOutOfThisWorldAreRefused) {
  const auto error_at = [](const std::string& x) {
    return InputErrorOf(
        [&] { ParsePoses("x,y,z,qx,qy,qz,qw\n" + x + ",0,0,0,0,0,1\n", "poses.csv", *FindPoseFormat("ros")); });
  };
  EXPECT_THAT(error_at("1e308"), HasSubstr("poses.csv:2: 'x' is larger than any robot's"));
  EXPECT_THAT(error_at("1e7"), HasSubstr("poses.csv:2: the pose is absurdly far away"));
}

TEST(PoseFileTest, CapturesNamesMayHaveAColumnOfTheirOwn) {
  EXPECT_EQ(Parse("capture,x,y,z,qx,qy,qz,qw\n007,1,2,3,0,0,0,1\n").front().image, "007");
  EXPECT_THAT(ErrorOf("image,capture,x,y,z,qx,qy,qz,qw\n"), StartsWith("poses.csv:1: unknown column 'capture'"));
}

TEST(PoseFileTest, ColumnsBeyondTheLastNumberAreTooMany) {
  const PoseFormat joints = NumbersFormat({"j1", "j2", "j3"});
  const auto error_of = [&](const std::string& text) {
    return InputErrorOf([&] { ParsePoses(text, "joints.csv", joints); });
  };
  EXPECT_EQ(error_of("image,j1,j2,j3,j4\na,1,2,3,4\n"),
            "joints.csv:1: column 'j4' is one too many; needed: j1, j2, j3");
  EXPECT_THAT(error_of("image,j1,j2,j3,j10\na,1,2,3,4\n"), StartsWith("joints.csv:1: column 'j10' is one too many"));
  EXPECT_THAT(error_of("image,j0,j2,j3\na,1,2,3\n"), StartsWith("joints.csv:1: unknown column 'j0'"));
}

TEST(PoseFileTest, ReportsFaultsOfTheHeader) {
  EXPECT_EQ(ErrorOf(""), "poses.csv: is empty; a header line and one line per capture are needed");
  EXPECT_EQ(ErrorOf("\n# only this\n"), "poses.csv: is empty; a header line and one line per capture are needed");
  EXPECT_EQ(ErrorOf(kHeader), "poses.csv: has a header but no captures");
  EXPECT_THAT(ErrorOf("# c\nimage,x,y,z,qx,qy,qz\n"),
              StartsWith("poses.csv:2: column 'qw' is missing; needed: x, y, z, qx"));
  EXPECT_THAT(ErrorOf("imgae,x,y,z,qx,qy,qz,qw\n"),
              StartsWith("poses.csv:1: unknown column 'imgae'; did you mean 'image'?"));
  EXPECT_THAT(ErrorOf("image,x,y,z,qx,qy,qz,qw,\n"), StartsWith("poses.csv:1: column 9 has no name"));
  EXPECT_THAT(ErrorOf("x,x,y,z,qx,qy,qz,qw\n"), StartsWith("poses.csv:1: column 'x' occurs twice"));
  EXPECT_THAT(ErrorOf("1,2,3,0,0,0,1\n"), StartsWith("poses.csv:1: the first line must name the columns: image, x, y"));
  EXPECT_THAT(ErrorOf("image,x,y,z,rx,ry,rz\n"),
              HasSubstr("the columns here are those of pose format ur or techman or staubli"));
  EXPECT_THAT(ErrorOf("image,x,y,z\n", "kuka"), StartsWith("poses.csv:1: column 'a' is missing"));
}

TEST(PoseFileTest, RowFaultsNameLineAndColumn) {
  EXPECT_EQ(ErrorOf(kHeader + "a.png,1,2,3,0,0,0,1\nb.png,1,2,,0,0,0,1\n"),
            "poses.csv:3: column 'z': a number is missing");
  EXPECT_EQ(ErrorOf(kHeader + "a.png,1,2,3 mm,0,0,0,1\n"), "poses.csv:2: column 'z': '3 mm' is not a number");
  EXPECT_EQ(ErrorOf(kHeader + "a.png,1,2,nan,0,0,0,1\n"), "poses.csv:2: column 'z': 'nan' is not finite");
  EXPECT_EQ(ErrorOf(kHeader + "a.png,1,inf,3,0,0,0,1\n"), "poses.csv:2: column 'y': 'inf' is not finite");
  EXPECT_EQ(ErrorOf(kHeader + "a.png,1,2,3,0,0,0\n"), "poses.csv:2: 7 fields, but the header names 8 columns");
  EXPECT_EQ(ErrorOf(kHeader + "a.png,1,2,3,0,0,0,1,\n"), "poses.csv:2: 9 fields, but the header names 8 columns");
  EXPECT_EQ(ErrorOf(kHeader + "a.png,1,2,3,0.5,0,0,0\n"), "poses.csv:2: the quaternion's length is 0.5000, not 1");
  EXPECT_EQ(ErrorOf(kHeader + ",1,2,3,0,0,0,1\n"), "poses.csv:2: column 'image': the file name is missing");
  EXPECT_EQ(ErrorOf(kHeader + "a.png,1,2,3,0,0,0,1\n\na.png,1,2,3,0,0,0,1\n"),
            "poses.csv:4: column 'image': 'a.png' already occurs in line 2");
  EXPECT_EQ(ErrorOf(kHeader + "\"a.png,1,2,3,0,0,0,1\n"), "poses.csv:2: field 1: the quote is not closed");
  EXPECT_EQ(ErrorOf(kHeader + "\"a\" b,1,2,3,0,0,0,1\n"), "poses.csv:2: field 1: 'b' follows the closing quote");
  EXPECT_THAT(
      ErrorOf("role,x,y,z,qx,qy,qz,qw\nhoem,1,2,3,0,0,0,1\n"),
      StartsWith("poses.csv:2: column 'role': 'hoem' is unknown; did you mean 'home'? One of: home, translate_x, "
                 "translate_y, rotate, free"));
  // Decimal commas cannot be told from commas between fields.
  EXPECT_THAT(ErrorOf("x,y,z,qx,qy,qz,qw\n0,5,0,1,0,2,0,0,0,0,0,0,1,0\n"),
              StartsWith("poses.csv:2: the numbers have decimal commas, and commas separate the columns too"));
}

TEST(PoseFileTest, ReadsDecimalCommasBetweenOtherSeparators) {
  const std::vector<PoseRow> rows =
      ParsePoses("x;y;z;qx;qy;qz;qw\n0,5;-1,25;0;0;0;0;1\n", "poses.csv", *FindPoseFormat("ros"));
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].pose.translation, Eigen::Vector3d(0.5, -1.25, 0));
}

TEST(PoseFileTest, MessagesAreOneShortLine) {
  const std::string error = ErrorOf(kHeader + "a.png,\x01\x02" + std::string(100000, 'x') + ",2,3,0,0,0,1\n");
  EXPECT_THAT(error, StartsWith("poses.csv:2: column 'x': '\?\?xxx"));
  EXPECT_LT(error.size(), 200u);
  EXPECT_LT(ErrorOf(std::string(1000000, 'x') + ",y\n").size(), 400u);
  EXPECT_THAT(ErrorOf(std::string("\xFF\xFEi\0m\0", 6)), HasSubstr("save it as CSV in UTF-8"));
}

TEST(PoseFileTest, LimitsTheNumberOfRows) {
  std::string text = "x,y,z,rx,ry,rz\n";
  for (int i = 0; i < 1000001; ++i) text += "0,0,0,0,0,0\n";
  EXPECT_EQ(ErrorOf(text, "ur"), "poses.csv:1000002: more than 1000000 captures");
}

TEST(PoseFileTest, JointsGiveTheFlangesPose) {
  const std::string text = "image,j1,j2,j3,j4,j5,j6\na.png,10,-90,45,-30,80,5\n";
  const PoseRow row = ParsePoses(text, "poses.csv", JointFormat("ur10e", "deg")).front();
  JointAngles joints_rad = {10, -90, 45, -30, 80, 5};
  for (double& joint : joints_rad) joint = DegToRad(joint);
  EXPECT_LT(LocalCoordinates(BaseFromFlange(*FindUrRobot("ur10e"), joints_rad), row.pose).norm(), 1e-14);
  const auto too_few = [] { ParsePoses("j1,j2,j3,j4,j5\n0,0,0,0,0\n", "poses.csv", JointFormat("ur5", "rad")); };
  EXPECT_THAT(InputErrorOf(too_few), HasSubstr("column 'j6' is missing"));
  // Joints without a header are in the order of the arm, base first; any other number of columns needs one.
  const PoseRow bare = ParsePoses("10,-90,45,-30,80,5\n", "poses.csv", JointFormat("ur10e", "deg")).front();
  EXPECT_LT(LocalCoordinates(row.pose, bare.pose).norm(), 1e-14);
  const auto seven = [] { ParsePoses("1,10,-90,45,-30,80,5\n", "poses.csv", JointFormat("ur10e", "deg")); };
  EXPECT_THAT(InputErrorOf(seven), HasSubstr("the first line must name the columns"));
}

TEST(PoseFileTest, WritesWhatItReads) {
  Rng rng(4);
  for (const PoseFormat& format : PoseFormats()) {
    std::vector<PoseRow> rows;
    for (int i = 0; i < 10; ++i) {
      PoseRow row;
      row.image = i == 0 ? "#odd, \"name\".png" : "image_" + std::to_string(i) + ".png";
      row.role = i == 0 ? CaptureRole::kHome : CaptureRole::kNone;
      const Eigen::Vector3d rotation_vector = rng.NormalVector3();
      row.pose = Rigid3d(ExpRotation(rotation_vector), rng.NormalVector3());
      rows.push_back(row);
    }
    const std::vector<PoseRow> read = ParsePoses(PoseFileText(rows, format), "poses.csv", format);
    ASSERT_EQ(read.size(), rows.size());
    for (size_t i = 0; i < rows.size(); ++i) {
      EXPECT_EQ(read[i].image, rows[i].image);
      EXPECT_EQ(read[i].role, rows[i].role);
      EXPECT_NEAR(AngleRad(read[i].pose, rows[i].pose), 0, kRoundOff) << format.name;
      EXPECT_NEAR(DistanceM(read[i].pose, rows[i].pose), 0, kRoundOff) << format.name;
    }
  }
}

TEST(PoseFileTest, TimesAreReadAndWritten) {
  const std::vector<PoseRow> rows =
      ParsePoses("time,x,y,z,qx,qy,qz,qw\n1700000000.25,1,2,3,0,0,0,1\n1700000001500000000,1,2,3,0,0,0,1\n", "p.csv",
                 Format("ros"));
  EXPECT_EQ(*rows[0].time_s, 1700000000.25);
  // Nanoseconds.
  EXPECT_NEAR(*rows[1].time_s, 1700000001.5, 1e-6);
  const std::string text = PoseFileText(rows, Format("ros"));
  EXPECT_EQ(*ParsePoses(text, "p.csv", Format("ros"))[0].time_s, 1700000000.25);
  EXPECT_THAT(InputErrorOf([] { ParsePoses("time,x,y,z,qx,qy,qz,qw\n12:30,1,2,3,0,0,0,1\n", "p.csv", Format("ros")); }),
              testing::HasSubstr("column 'time': '12:30' is not a number"));
  // A format that skips columns skips this one, too.
  PoseFormat own = Format("ros");
  own.file_columns = own.columns;
  own.file_columns.insert(own.file_columns.begin(), std::string(kNoColumn));
  EXPECT_FALSE(ParsePoses("time,x,y,z,qx,qy,qz,qw\n12:30,1,2,3,0,0,0,1\n", "p.csv", own)[0].time_s);
}

TEST(PoseFileTest, ReadsFiles) {
  const TempFolder folder;
  std::ofstream(folder / "poses.csv") << kHeader << "a.png,1,2,3,0,0,0,1\n";
  EXPECT_EQ(ReadPoseFile(folder / "poses.csv", Format("ros")).size(), 1u);
  EXPECT_THAT(InputErrorOf([&] { ReadPoseFile(folder / "none.csv", Format("ros")); }),
              HasSubstr("none.csv: there is no such file"));
}

// Files recorded by others.
TEST(PoseFileTest, ReadsRecordedFiles) {
  HEBA_SKIP_WITHOUT(DataDir());
  EXPECT_EQ(ReadPoseFile(DataDir() / "chjohnkim_ur5_chess" / "poses.csv", Format("ros")).size(), 20u);
  EXPECT_EQ(ReadPoseFile(DataDir() / "metric_workcell_camera2" / "poses.csv", Format("ros")).size(), 121u);
}

// Any sequence of bytes gives either rows or an InputError whose message is one line.
TEST(PoseFileTest, AnyTextGivesRowsOrAnInputError) {
  const std::string valid = kHeader + "\"a.png\",1,2,3,0,0,0,1\nb.png,1,2e3,-3,0,0.6,0,0.8\n";
  Rng rng(5);
  int num_valid = 0;
  for (int i = 0; i < 20000; ++i) {
    std::string text = valid;
    for (int k = 0; k <= rng.Index(4); ++k) {
      const size_t at = static_cast<size_t>(rng.Index(static_cast<int>(text.size())));
      const char c = rng.Uniform() < 0.5 ? ",;\t\"\n\r# .-e"[rng.Index(11)] : static_cast<char>(rng.Index(256));
      if (rng.Uniform() < 0.5) {
        text[at] = c;
      } else {
        text.insert(at, 1, c);
      }
    }
    try {
      num_valid += Parse(text).empty() ? 0 : 1;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), StartsWith("poses.csv:"));
      EXPECT_THAT(error.what(), testing::Not(HasSubstr("\n")));
    }
  }
  // The changes are small enough to leave some files valid and large enough to make most invalid.
  EXPECT_GT(num_valid, 1000);
  EXPECT_LT(num_valid, 19000);
}

TEST(PoseFileTest, ColumnsBesideThePoseAreReadAllOrNone) {
  const PoseFormat& format = *FindPoseFormat("ros");
  const std::vector<std::string> extra = {"j1", "j2"};
  const std::string pose = "1,2,3,0,0,0,1";
  const std::vector<PoseRow> rows = ParsePoses("j2,x,y,z,qx,qy,qz,qw,j1\n8," + pose + ",7\n", "p.csv", format, extra);
  EXPECT_EQ(rows.front().extras, (std::vector<double>{7, 8}));
  EXPECT_EQ(ParsePoses(PoseFileText(rows, format, extra), "p.csv", format, extra).front().extras, rows.front().extras);
  EXPECT_TRUE(ParsePoses("x,y,z,qx,qy,qz,qw\n" + pose + "\n", "p.csv", format, extra).front().extras.empty());
  EXPECT_EQ(InputErrorOf([&] { ParsePoses("x,y,z,qx,qy,qz,qw,j2\n" + pose + ",8\n", "p.csv", format, extra); }),
            "p.csv:1: column 'j1' is missing; needed are all of j1, j2, or none");
  EXPECT_EQ(InputErrorOf([&] { ParsePoses("x,y,z,qx,qy,qz,qw,j1,j2\n" + pose + ",8,x\n", "p.csv", format, extra); }),
            "p.csv:2: column 'j2': 'x' is not a number");
  EXPECT_THAT(InputErrorOf([&] { ParsePoses("x,y,z,qx,qy,qz,qw,j1\n" + pose + ",8\n", "p.csv", format); }),
              testing::HasSubstr("unknown column 'j1'"));
}

}  // namespace
}  // namespace heba
