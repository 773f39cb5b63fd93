#include "tools/doctor/pose_guess.h"

#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/io/pose_source.h"
#include "tests/support/matchers.h"
#include "tests/support/scenes.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Three poses with positions of several hundred mm and rotations about several axes.
std::vector<Rigid3d> SomePoses() {
  return {Rigid3d(ExpRotation({0.3, -0.5, 1.1}), {0.25, -0.5, 0.75}),
          Rigid3d(ExpRotation({1.3, 0.2, -0.4}), {0.35, -0.4, 0.6}),
          Rigid3d(ExpRotation({-0.7, 0.9, 0.1}), {0.3, -0.55, 0.8})};
}

PoseFormat FormatOf(const std::string& rotation, const std::string& angle_unit, const std::string& translation_unit) {
  const bool has_four = rotation.starts_with("quaternion");
  return {"",
          has_four ? std::vector<std::string>{"x", "y", "z", "r4", "r5", "r6", "r7"}
                   : std::vector<std::string>{"x", "y", "z", "r4", "r5", "r6"},
          translation_unit, rotation, angle_unit};
}

class PoseGuessTest : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  // Writes one line for each of the poses: text before the numbers, and text after them.
  std::filesystem::path WriteTable(const PoseFormat& format, const std::string& header = "",
                                   const std::vector<std::string>& before = {"", "", ""},
                                   const std::string& separator = ",") const {
    std::string text = header;
    size_t i = 0;
    for (const Rigid3d& pose : SomePoses()) {
      std::vector<std::string> fields;
      for (const double number : NumbersFromPose(format, pose)) fields.push_back(RoundTrip(number));
      text += before[i++] + Join(fields, separator) + "\n";
    }
    return Write("poses.csv", text);
  }

  TempFolder folder_;
};

struct UnitGuess {
  std::string name;
  PoseFormat format;
};

class UnitGuessTest : public PoseGuessTest, public testing::WithParamInterface<UnitGuess> {};

// The guessed format reads the poses that were written.
TEST_P(UnitGuessTest, FollowsFromTheSizeOfTheNumbers) {
  const PoseFormat& format = GetParam().format;
  const std::filesystem::path file = WriteTable(format);
  const GuessedTable guessed = GuessPoseFormats(file);
  EXPECT_EQ(guessed.num_rows, 3u);
  ASSERT_FALSE(guessed.formats.empty());
  EXPECT_EQ(guessed.formats[0].translation_unit, format.translation_unit);
  EXPECT_EQ(guessed.formats[0].rotation, format.rotation);
  EXPECT_EQ(guessed.formats[0].angle_unit, format.angle_unit);
  const std::vector<PoseRow> rows = ReadPoses(file, guessed.formats[0]);
  ASSERT_THAT(rows, SizeIs(3));
  for (size_t i = 0; i < 3; ++i) EXPECT_THAT(rows[i].pose, IsNearPose(SomePoses()[i], 1e-6, 1e-9));
}

INSTANTIATE_TEST_SUITE_P(
    , UnitGuessTest,
    testing::Values(
        UnitGuess{"RotationVectorInRadAndM", FormatOf("rotation_vector", "rad", "m")},
        UnitGuess{"RotationVectorInRadAndMm", FormatOf("rotation_vector", "rad", "mm")},
        UnitGuess{"EulerAnglesInDegAndMm", FormatOf("euler_zyx", "deg", "mm")},
        UnitGuess{"EulerAnglesInDegAndM", FormatOf("euler_zyx", "deg", "m")},
        UnitGuess{"QuaternionInM", FormatOf("quaternion_xyzw", "", "m")},
        UnitGuess{"QuaternionInMm", FormatOf("quaternion_xyzw", "", "mm")},
        UnitGuess{"WholeMatrixInM", *FindPoseFormat("matrix")},
        UnitGuess{"PositionAndMatrixInMm",
                  {"", {"x", "y", "z", "r4", "r5", "r6", "r7", "r8", "r9", "r10", "r11", "r12"}, "mm", "matrix", ""}}),
    [](const auto& guess) { return guess.param.name; });

TEST_F(PoseGuessTest, AWholeMatrixMayBeInMillimetres) {
  PoseFormat format = *FindPoseFormat("matrix");
  format.translation_unit = "mm";
  const GuessedTable guessed = GuessPoseFormats(WriteTable(format));
  ASSERT_THAT(guessed.formats, SizeIs(1));
  EXPECT_EQ(guessed.formats[0].translation_unit, "mm");
  EXPECT_EQ(guessed.formats[0].columns.size(), 16u);
}

TEST_F(PoseGuessTest, TheHeightOfAWholeMatrixDeterminesItsUnitToo) {
  std::string text;
  for (const char* z_mm : {"600", "650", "700"})
    text += std::string("1 0 0 5  0 1 0 -8  0 0 1 ") + z_mm + "  0 0 0 1\n";
  const GuessedTable guessed = GuessPoseFormats(Write("poses.txt", text));
  ASSERT_THAT(guessed.formats, SizeIs(1));
  EXPECT_EQ(guessed.formats[0].translation_unit, "mm");
}

TEST_F(PoseGuessTest, TwelveNumbersMayBeTheUpperRowsOfAMatrix) {
  std::string text;
  for (const Rigid3d& pose : SomePoses()) {
    const std::vector<double> numbers = NumbersFromPose(*FindPoseFormat("matrix"), pose);
    for (size_t i = 0; i < 12; ++i) text += RoundTrip(numbers[i]) + (i < 11 ? " " : "\n");
  }
  const std::filesystem::path file = Write("poses.txt", text);
  const GuessedTable guessed = GuessPoseFormats(file);
  ASSERT_THAT(guessed.formats, SizeIs(1));
  EXPECT_EQ(guessed.formats[0].translation_unit, "m");
  const std::vector<PoseRow> rows = ReadPoses(file, guessed.formats[0]);
  ASSERT_THAT(rows, SizeIs(3));
  for (size_t i = 0; i < 3; ++i) EXPECT_THAT(rows[i].pose, IsNearPose(SomePoses()[i], 1e-6, 1e-9));
}

TEST_F(PoseGuessTest, SixNumbersMayStateTheRotationFirst) {
  const GuessedTable guessed = GuessPoseFormats(Write("poses.txt", "1 2 3 0 0 1\n1 2 4 0 1 0\n1 2 5 1 0 0\n"));
  ASSERT_THAT(guessed.formats, SizeIs(2));
  EXPECT_THAT(guessed.formats[0].file_columns, ElementsAre("x", "y", "z", "r4", "r5", "r6"));
  EXPECT_THAT(guessed.formats[1].file_columns, ElementsAre("r4", "r5", "r6", "x", "y", "z"));
}

TEST_F(PoseGuessTest, TheQuaternionIsFoundByItsLength) {
  std::string text;
  for (const Rigid3d& pose : SomePoses()) {
    std::vector<double> numbers = NumbersFromPose(*FindPoseFormat("ros"), pose);
    std::rotate(numbers.begin(), numbers.begin() + 3, numbers.end());
    for (const double number : numbers) text += RoundTrip(number) + " ";
    text += "\n";
  }
  const std::filesystem::path file = Write("poses.txt", text);
  const GuessedTable guessed = GuessPoseFormats(file);
  ASSERT_THAT(guessed.formats, SizeIs(1));
  EXPECT_THAT(guessed.formats[0].file_columns, ElementsAre("r4", "r5", "r6", "r7", "x", "y", "z"));
  EXPECT_THAT(ReadPoses(file, guessed.formats[0])[0].pose, IsNearPose(SomePoses()[0], 1e-6, 1e-9));
}

TEST_F(PoseGuessTest, TheHeaderNamesThePosition) {
  const std::filesystem::path file = WriteTable(FormatOf("euler_zyx", "deg", "mm"),
                                                "A [deg];B [deg];C [deg];X [mm];Y [mm];Z [mm]\n", {"", "", ""}, ";");
  const GuessedTable guessed = GuessPoseFormats(file);
  ASSERT_THAT(guessed.formats, SizeIs(1));
  EXPECT_THAT(guessed.formats[0].columns, ElementsAre("X [mm]", "Y [mm]", "Z [mm]", "A [deg]", "B [deg]", "C [deg]"));
}

TEST_F(PoseGuessTest, TheHeaderIsAFormatThatAConfigReads) {
  const std::filesystem::path file = WriteTable(FormatOf("euler_zyx", "deg", "mm"), "X [mm],Y [mm],Z [mm],A,B,C\n");
  const GuessedTable guessed = GuessPoseFormats(file);
  ASSERT_THAT(guessed.formats, SizeIs(1));
  const PoseFormat read = ReadPoseFormat(ParseYaml(PoseFormatText(guessed.formats[0]), "cell.yaml"));
  EXPECT_THAT(ReadPoses(file, read)[0].pose, IsNearPose(SomePoses()[0], 1e-6, 1e-9));
}

TEST_F(PoseGuessTest, QuotationMarksInTheHeaderAreEscaped) {
  const std::filesystem::path file = WriteTable(FormatOf("euler_zyx", "deg", "mm"), "x',y',z',a,b,c\n");
  const GuessedTable guessed = GuessPoseFormats(file);
  ASSERT_THAT(guessed.formats, SizeIs(1));
  const PoseFormat read = ReadPoseFormat(ParseYaml(PoseFormatText(guessed.formats[0]), "cell.yaml"));
  EXPECT_THAT(read.columns, ElementsAre("x'", "y'", "z'", "a", "b", "c"));
  EXPECT_THAT(ReadPoses(file, read)[0].pose, IsNearPose(SomePoses()[0], 1e-6, 1e-9));
}

// The names of the quaternion's columns count once a config reads the format, whatever their order in the file.
TEST_F(PoseGuessTest, AConfigReadsTheQuaternionByItsNames) {
  const PoseFormat format = FormatOf("quaternion_wxyz", "", "m");
  const std::filesystem::path file = WriteTable(format, "x,y,z,qw,qx,qy,qz\n");
  const GuessedTable guessed = GuessPoseFormats(file);
  ASSERT_THAT(guessed.formats, SizeIs(1));
  const PoseFormat read = ReadPoseFormat(ParseYaml(PoseFormatText(guessed.formats[0]), "cell.yaml"));
  EXPECT_THAT(ReadPoses(file, read)[0].pose, IsNearPose(SomePoses()[0], 1e-6, 1e-9));
}

TEST_F(PoseGuessTest, ImagesAndTextAreNotNumbersOfThePose) {
  const std::filesystem::path file =
      WriteTable(FormatOf("euler_zyx", "deg", "mm"), "", {"ok,a.png,", "ok,b.png,", "ok,c.png,"});
  const GuessedTable guessed = GuessPoseFormats(file);
  ASSERT_FALSE(guessed.formats.empty());
  EXPECT_THAT(guessed.formats[0].file_columns, ElementsAre("-", "image", "x", "y", "z", "r4", "r5", "r6"));
  const std::vector<PoseRow> rows = ReadPoses(file, guessed.formats[0]);
  ASSERT_THAT(rows, SizeIs(3));
  EXPECT_EQ(rows[2].image, "c.png");
}

TEST_F(PoseGuessTest, AnIndexOrATimeMayPrecedeThePose) {
  for (const PoseFormat& format : {FormatOf("euler_zyx", "deg", "mm"), FormatOf("quaternion_xyzw", "", "m")}) {
    const GuessedTable guessed =
        GuessPoseFormats(WriteTable(format, "", {"1305031102.1,", "1305031102.2,", "1305031102.3,"}));
    ASSERT_FALSE(guessed.formats.empty()) << format.rotation;
    EXPECT_EQ(guessed.formats[0].file_columns.at(0), "-");
    EXPECT_EQ(guessed.formats[0].columns.size(), format.columns.size());
    EXPECT_EQ(guessed.formats[0].rotation, format.rotation);
  }
}

TEST_F(PoseGuessTest, BracketsAndBlanksAreAccepted) {
  const std::filesystem::path file =
      Write("poses.txt", "p[0.1, 0.2, 0.3, 0, 0, 1]\np[0.2, 0.2, 0.3, 0, 1, 0]\np[0.3, 0.2, 0.3, 1, 0, 0]\n");
  EXPECT_EQ(GuessPoseFormats(file).num_rows, 3u);
  // Positions in mm are larger than any angle, so that the order is known.
  EXPECT_THAT(GuessPoseFormats(WriteTable(FormatOf("euler_zyx", "deg", "mm"), "", {"", "", ""}, "  ")).formats,
              SizeIs(1));
}

TEST_F(PoseGuessTest, ReadsAFolderWithOneFilePerPose) {
  int number = 0;
  for (const Rigid3d& pose : SomePoses()) {
    const std::vector<double> q = NumbersFromPose(*FindPoseFormat("ros"), pose);
    Write("poses/pose_" + std::to_string(number++) + ".yaml",
          "position: {x: " + RoundTrip(q[0]) + ", y: " + RoundTrip(q[1]) + ", z: " + RoundTrip(q[2]) +
              "}\norientation: {x: " + RoundTrip(q[3]) + ", y: " + RoundTrip(q[4]) + ", z: " + RoundTrip(q[5]) +
              ", w: " + RoundTrip(q[6]) + "}\n");
  }
  const GuessedTable guessed = GuessPoseFormats(folder_ / "poses");
  EXPECT_EQ(guessed.num_rows, 3u);
  ASSERT_THAT(guessed.formats, SizeIs(1));
  EXPECT_EQ(guessed.formats[0].rotation, "quaternion_xyzw");
  EXPECT_EQ(guessed.formats[0].translation_unit, "m");
}

struct NoTable {
  std::string name;
  std::string text;
};

class NoTableTest : public PoseGuessTest, public testing::WithParamInterface<NoTable> {};

TEST_P(NoTableTest, HasNoFormats) {
  EXPECT_THAT(GuessPoseFormats(Write("poses.txt", GetParam().text)).formats, IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(
    , NoTableTest,
    testing::Values(NoTable{"Prose", "nothing of the kind\nis in this file\nor in this line\n"}, NoTable{"Empty", ""},
                    NoTable{"TwoRows", "1 2 3 0 0 1\n1 2 4 0 1 0\n"},
                    NoTable{"UnevenRows", "1 2 3 0 0 1\n1 2 4 0 1 0\n1 2 5 1 0\n"},
                    NoTable{"FiveColumns", "1 2 3 0 0\n1 2 4 0 1\n1 2 5 1 0\n"},
                    NoTable{"MisspeltNumber", "1 2 3 0 0 1\n1 2 4 0 1 0\n1 2 5 l 0 0\n1 2 6 0 0 1\n"},
                    NoTable{"EightNumbersWithoutAQuaternion", "1 2 3 4 5 6 7 8\n1 2 3 4 5 6 7 9\n1 2 3 4 5 6 7 7\n"},
                    NoTable{"JointsByName", "j1,j2,j3,j4,j5,j6\n0,0,0,0,0,1\n0,0,0,0,1,0\n0,0,0,1,0,0\n"},
                    NoTable{"HeaderOfAnotherWidth", "x,y,z\n1,2,3,0,0,1\n1,2,4,0,1,0\n1,2,5,1,0,0\n"}),
    [](const auto& table) { return table.param.name; });

TEST_F(PoseGuessTest, AMissingFileHasNoFormats) {
  EXPECT_THAT(GuessPoseFormats(folder_ / "absent.csv").formats, IsEmpty());
}

TEST(PoseFormatSettingTest, IsASettingOfAConfig) {
  EXPECT_EQ(PoseFormatSetting(*FindPoseFormat("kuka")), "captures.pose_format=kuka");
  EXPECT_EQ(PoseFormatSetting(FormatOf("euler_xyz", "deg", "m")),
            "captures.pose_format={columns: [x, y, z, r4, r5, r6], translation: m, rotation: euler_xyz, angle: deg}");
}

TEST(ReadingInWordsTest, StatesNumbersAndUnits) {
  EXPECT_EQ(ReadingInWords(FormatOf("euler_zyx", "deg", "mm")),
            "6 numbers per pose: x, y, z in mm and euler_zyx in deg");
  EXPECT_EQ(ReadingInWords(FormatOf("quaternion_xyzw", "", "m")),
            "7 numbers per pose: x, y, z in m and quaternion_xyzw");
  EXPECT_EQ(ReadingInWords(*FindPoseFormat("matrix")), "16 numbers per pose: a 4 x 4 matrix row by row, in m");
}

// A data set without images: the poses of the robot in a format that the config does not name, and those of the target
// in the camera.
class GuessReadingTest : public PoseGuessTest {
 protected:
  void WriteSet(const PoseFormat& written, const std::string& header) const {
    const TestScene scene = MakeTestScene(/*seed=*/1);
    std::string robot = header;
    std::string seen = "x,y,z,qx,qy,qz,qw\n";
    for (const PosePair& pair : scene.pairs) {
      robot += Row(written, BaseFromGripper(Setup::kEyeToHand, pair.camera_mount_from_target_mount));
      seen += Row(*FindPoseFormat("ros"), pair.camera_from_target);
    }
    Write("robot.csv", robot);
    Write("seen.csv", seen);
    Write("cell.yaml", "setup: eye_to_hand\ncaptures: {target_poses: seen.csv, poses: robot.csv}\n");
  }
  static std::string Row(const PoseFormat& format, const Rigid3d& pose) {
    std::vector<std::string> fields;
    for (const double number : NumbersFromPose(format, pose)) fields.push_back(RoundTrip(number));
    return Join(fields, ",") + "\n";
  }
};

TEST_F(GuessReadingTest, TheImagesDetermineTheOrderOfTheAngles) {
  WriteSet(FormatOf("euler_xyz", "deg", "mm"), "");
  const std::optional<GuessedReading> reading = GuessReading(folder_ / "cell.yaml", {}, 1, Verbosity::kQuiet);
  ASSERT_TRUE(reading.has_value());
  EXPECT_TRUE(reading->fits);
  EXPECT_EQ(reading->format.rotation, "euler_xyz");
  EXPECT_EQ(reading->format.angle_unit, "deg");
  EXPECT_EQ(reading->format.translation_unit, "mm");
  EXPECT_EQ(reading->diagnosis.NumWrong(), 0);
}

TEST_F(GuessReadingTest, TheImagesDetermineThatTheRotationComesFirst) {
  const TestScene scene = MakeTestScene(/*seed=*/1);
  WriteSet(FormatOf("euler_zyx", "deg", "mm"), "");
  std::string robot;
  for (const PosePair& pair : scene.pairs) {
    std::vector<double> numbers = NumbersFromPose(
        FormatOf("euler_zyx", "deg", "mm"), BaseFromGripper(Setup::kEyeToHand, pair.camera_mount_from_target_mount));
    std::rotate(numbers.begin(), numbers.begin() + 3, numbers.end());
    for (size_t i = 0; i < 6; ++i) robot += RoundTrip(numbers[i]) + (i < 5 ? " " : "\n");
  }
  Write("robot.csv", robot);
  const std::optional<GuessedReading> reading = GuessReading(folder_ / "cell.yaml", {}, 1, Verbosity::kQuiet);
  ASSERT_TRUE(reading.has_value());
  EXPECT_TRUE(reading->fits);
  EXPECT_THAT(reading->format.file_columns, ElementsAre("r4", "r5", "r6", "x", "y", "z"));
}

TEST_F(GuessReadingTest, HasNoReadingOfAConfigWithAnotherFault) {
  WriteSet(FormatOf("euler_xyz", "deg", "mm"), "");
  EXPECT_FALSE(GuessReading(folder_ / "cell.yaml", {"setup=eye_on_hand"}, 1, Verbosity::kQuiet).has_value());
  Write("robot.csv", "nothing of the kind\n");
  EXPECT_FALSE(GuessReading(folder_ / "cell.yaml", {}, 1, Verbosity::kQuiet).has_value());
  EXPECT_FALSE(GuessReading(folder_ / "absent.yaml", {}, 1, Verbosity::kQuiet).has_value());
}

}  // namespace
}  // namespace heba
