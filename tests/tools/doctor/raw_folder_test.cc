#include "tools/doctor/raw_folder.h"

#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/config/yaml_reader.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::SizeIs;

// A folder as a user has it after recording. Images are empty files, because they are counted and not opened.
class RawFolderTest : public testing::Test {
 protected:
  void Write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }
  void WriteImages(const std::string& folder, int num_images) const {
    for (int i = 0; i < num_images; ++i) Write(folder + std::to_string(i) + ".png", "");
  }

  static constexpr const char* kKukaPoses =
      "100,200,300,10,20,30\n110,200,300,20,20,30\n120,200,300,30,20,10\n130,200,300,30,20,50\n";
  static constexpr const char* kCamera =
      "{model: pinhole, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240}\n";
  static constexpr const char* kTarget = "{type: chessboard, rows: 5, columns: 8, square: 20 mm}\n";
  TempFolder folder_;
};

TEST_F(RawFolderTest, FindsImagesAndATableBesideOneAnother) {
  WriteImages("", 4);
  Write("robot.txt", kKukaPoses);
  const std::optional<RawFolder> raw = FindRawFolder(folder_.path());
  ASSERT_TRUE(raw.has_value());
  EXPECT_EQ(raw->images, folder_.path());
  EXPECT_EQ(raw->num_images, 4u);
  EXPECT_EQ(raw->found.front().source, folder_ / "robot.txt");
  EXPECT_EQ(raw->found.front().format.translation_unit, "mm");
  EXPECT_EQ(raw->found.front().format.angle_unit, "deg");
  EXPECT_FALSE(raw->camera.has_value());
  EXPECT_FALSE(raw->target.has_value());
}

TEST_F(RawFolderTest, TheFolderWithTheMostImagesIsChosen) {
  WriteImages("thumbnails/", 2);
  WriteImages("camera/", 4);
  Write("robot.txt", kKukaPoses);
  const std::optional<RawFolder> raw = FindRawFolder(folder_.path());
  ASSERT_TRUE(raw.has_value());
  EXPECT_EQ(raw->images, folder_ / "camera");
}

TEST_F(RawFolderTest, ATableBesideTheImagesIsFound) {
  WriteImages("camera/", 4);
  Write("camera/robot.txt", kKukaPoses);
  const std::optional<RawFolder> raw = FindRawFolder(folder_.path());
  ASSERT_TRUE(raw.has_value());
  EXPECT_EQ(raw->found.front().source, folder_ / "camera/robot.txt");
}

TEST_F(RawFolderTest, RecognisesCameraAndTargetFiles) {
  WriteImages("", 4);
  Write("robot.txt", kKukaPoses);
  Write("lens.yaml", kCamera);
  Write("sheet.yaml", kTarget);
  const std::optional<RawFolder> raw = FindRawFolder(folder_.path());
  ASSERT_TRUE(raw.has_value());
  EXPECT_EQ(raw->camera, folder_ / "lens.yaml");
  EXPECT_EQ(raw->target, folder_ / "sheet.yaml");
  EXPECT_EQ(raw->found.front().source, folder_ / "robot.txt");
}

TEST_F(RawFolderTest, TheTableWithAsManyRowsAsImagesIsChosen) {
  WriteImages("", 4);
  Write("a.txt", std::string(kKukaPoses) + kKukaPoses);
  Write("b.txt", kKukaPoses);
  const std::optional<RawFolder> raw = FindRawFolder(folder_.path());
  ASSERT_TRUE(raw.has_value());
  EXPECT_EQ(raw->found.front().source, folder_ / "b.txt");
}

TEST_F(RawFolderTest, ATableTakesPrecedenceOverFilesOfOnePose) {
  WriteImages("", 4);
  for (int i = 0; i < 4; ++i) Write("poses/" + std::to_string(i) + ".txt", "100 200 300 10 20 30\n");
  ASSERT_TRUE(FindRawFolder(folder_.path()).has_value());
  EXPECT_EQ(FindRawFolder(folder_.path())->found.front().source, folder_ / "poses");
  Write("robot.txt", kKukaPoses);
  EXPECT_EQ(FindRawFolder(folder_.path())->found.front().source, folder_ / "robot.txt");
}

TEST_F(RawFolderTest, ImagesAndPosesAreBothNeeded) {
  EXPECT_FALSE(FindRawFolder(folder_.path()).has_value());
  Write("robot.txt", kKukaPoses);
  EXPECT_FALSE(FindRawFolder(folder_.path()).has_value());
  WriteImages("", 4);
  Write("robot.txt", "notes on the recording\n");
  EXPECT_FALSE(FindRawFolder(folder_.path()).has_value());
  EXPECT_FALSE(FindRawFolder(folder_ / "absent").has_value());
}

TEST_F(RawFolderTest, ConfigLeavesOpenWhatIsUnknown) {
  WriteImages("camera/", 4);
  Write("robot.txt", kKukaPoses);
  const RawConfig made = ConfigOf(*FindRawFolder(folder_.path()), folder_ / "cell.yaml", 1);
  const YAML::Node config = YAML::Load(made.text);
  // The unknown keys are comments.
  EXPECT_FALSE(config["setup"].IsDefined());
  EXPECT_FALSE(config["target"].IsDefined());
  EXPECT_THAT(made.text, HasSubstr("\n# setup: eye_to_hand  # or eye_in_hand\n"));
  EXPECT_THAT(made.text, HasSubstr("\n# target: target.yaml\n"));
  EXPECT_EQ(config["captures"]["images"].as<std::string>(), "camera");
  EXPECT_EQ(config["captures"]["poses"].as<std::string>(), "robot.txt");
  EXPECT_THAT(
      made.text,
      HasSubstr("  pose_format: {columns: [x, y, z, r4, r5, r6], translation: mm, rotation: euler_zyx, angle: deg}\n"));
  ASSERT_THAT(made.remarks, SizeIs(1));
  EXPECT_THAT(made.remarks[0], HasSubstr("the poses (" + (folder_ / "robot.txt").string() +
                                         ") contain 6 numbers per pose: x, y, z in mm and euler_zyx in deg, guessed "
                                         "from the size of the numbers: name the target and the setup"));
}

// The paths are those from the config, wherever it is.
TEST_F(RawFolderTest, PathsAreRelativeToTheConfig) {
  WriteImages("set/", 4);
  Write("set/robot.txt", kKukaPoses);
  Write("set/lens.yaml", kCamera);
  std::filesystem::create_directories(folder_ / "configs");
  const RawConfig made = ConfigOf(*FindRawFolder(folder_ / "set"), folder_ / "configs/cell.yaml", 1);
  const ConfigValue config = ParseYaml(made.text, folder_ / "configs/cell.yaml");
  EXPECT_EQ(config.node()["camera"]["intrinsics"].as<std::string>(), "../set/lens.yaml");
  EXPECT_EQ(config.node()["captures"]["images"].as<std::string>(), "../set");
  EXPECT_EQ(config.node()["captures"]["poses"].as<std::string>(), "../set/robot.txt");
}

TEST_F(RawFolderTest, SaysWhyTheDataSetCannotBeRead) {
  WriteImages("", 5);
  Write("robot.txt", kKukaPoses);
  Write("sheet.yaml", kTarget);
  const RawConfig made = ConfigOf(*FindRawFolder(folder_.path()), folder_ / "cell.yaml", 1);
  EXPECT_THAT(made.text, HasSubstr("target: \"sheet.yaml\"\n"));
  ASSERT_THAT(made.warnings, SizeIs(1));
  EXPECT_EQ(made.warnings[0], "the data set cannot be read: " + (folder_ / "robot.txt").string() +
                                  ": has 4 rows without an image column for 5 images; the counts must agree, or name "
                                  "the image of each row");
  EXPECT_FALSE(made.fits);
}

TEST_F(RawFolderTest, ReadsDecimalCommas) {
  WriteImages("", 4);
  for (const std::string between : {"; ", " ", "\t"}) {
    std::string poses;
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 6; ++k) poses += (k == 0 ? "" : between) + std::to_string(10 * k + i) + ",5";
      poses += "\n";
    }
    Write("robot.txt", poses);
    const std::optional<RawFolder> raw = FindRawFolder(folder_.path());
    ASSERT_TRUE(raw.has_value()) << poses;
    EXPECT_EQ(raw->found.front().num_rows, 4u);
    EXPECT_EQ(raw->found.front().format.columns.size(), 6u);
  }
}

// The program is known by its syntax, and records are named by their paths.
TEST_F(RawFolderTest, FindsProgramsAndRecords) {
  WriteImages("", 3);
  Write("waypoints.script",
        "  global a=p[.1, .2, .3, 1, 2, 3]\n  global b=p[.1, .2, .3, 1, 2, 2]\n"
        "  global c=p[.1, .2, .4, 1, 2, 3]\n");
  const std::optional<RawFolder> program = FindRawFolder(folder_.path());
  ASSERT_TRUE(program.has_value());
  EXPECT_EQ(program->found.front().format.name, "ur");
  std::filesystem::remove(folder_ / "waypoints.script");
  const std::string pose = "\"pose\": [100, 200, 300, 10, 20, 30]";
  Write("log.json", "{\"records\": [{" + pose + "}, {" + pose + "}, {" + pose + "}]}");
  const std::optional<RawFolder> records = FindRawFolder(folder_.path());
  ASSERT_TRUE(records.has_value());
  EXPECT_EQ(records->found.front().paths.pose, "records[].pose");
}

// No arm turns a joint of the wrist by 905 deg: these are positions.
TEST_F(RawFolderTest, AnAngleBeyondAFullTurnIsAPosition) {
  WriteImages("", 3);
  Write("robot.txt", "10 20 30 905 200 300\n10 20 40 905 210 300\n10 30 30 900 200 310\n");
  const std::optional<RawFolder> raw = FindRawFolder(folder_.path());
  ASSERT_TRUE(raw.has_value());
  EXPECT_THAT(raw->found.front().format.file_columns, testing::ElementsAre("r4", "r5", "r6", "x", "y", "z"));
}

TEST_F(RawFolderTest, AFaultOfTheTargetIsReportedFirst) {
  WriteImages("", 4);
  Write("robot.txt", kKukaPoses);
  Write("sheet.yaml", "{type: chessboard, rows: 5, columns: 8}\n");
  RawFolder raw = *FindRawFolder(folder_.path());
  EXPECT_FALSE(raw.target.has_value());
  raw.target = folder_ / "sheet.yaml";
  EXPECT_THAT(InputErrorOf([&] { ConfigOf(raw, folder_ / "cell.yaml", 1); }), HasSubstr("'square' is missing"));
}

}  // namespace
}  // namespace heba
