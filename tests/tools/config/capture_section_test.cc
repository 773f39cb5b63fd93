#include "tools/config/capture_section.h"

#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

PoseReading ReadReading(const std::string& yaml) {
  MapReader reader(ParseYaml(yaml, "cell.yaml"));
  return ReadPoseReading(reader);
}

TEST(PoseReadingTest, PosesAreThoseOfTheGripperInTheBaseInRosFormByDefault) {
  const PoseReading reading = ReadReading("{}");
  EXPECT_EQ(reading.format.name, "ros");
  EXPECT_TRUE(reading.is_base_from_gripper);
}

TEST(PoseReadingTest, ReadsFormatDirectionAndUnits) {
  const PoseReading reading = ReadReading("{pose_format: matrix, units: mm, poses_are: gripper_from_base}");
  EXPECT_EQ(reading.format.rotation, "matrix");
  EXPECT_EQ(reading.format.translation_unit, "mm");
  EXPECT_FALSE(reading.is_base_from_gripper);
}

TEST(PoseReadingTest, ReadsJointsOfAnArm) {
  const PoseReading reading = ReadReading("{pose_format: joints, robot: ur5e, joint_angles: deg}");
  EXPECT_EQ(reading.format.robot, "ur5e");
  EXPECT_EQ(reading.format.angle_unit, "deg");
  EXPECT_THAT(reading.format.columns, ElementsAre("j1", "j2", "j3", "j4", "j5", "j6"));
  EXPECT_EQ(ReadReading("{pose_format: joints, robot: ur5e}").format.angle_unit, "rad");
}

TEST(PoseReadingTest, RefusesWrongValuesWithTheirKey) {
  const auto error_of = [](const std::string& yaml) { return InputErrorOf([&] { ReadReading(yaml); }); };
  EXPECT_THAT(error_of("{pose_format: kuke}"), HasSubstr("cell.yaml:1: pose_format: 'kuke' is unknown"));
  EXPECT_THAT(error_of("{pose_format: kuka, units: mm}"), HasSubstr("cell.yaml:1: units: pose format 'kuka'"));
  EXPECT_THAT(error_of("{poses_are: base_from_griper}"), HasSubstr("cell.yaml:1: poses_are: 'base_from_griper'"));
  EXPECT_THAT(error_of("{pose_format: joints}"), HasSubstr("'robot' is missing"));
  EXPECT_THAT(error_of("{pose_format: joints, robot: ur6}"), HasSubstr("robot: 'ur6' is unknown"));
  EXPECT_THAT(error_of("{pose_format: joints, robot: ur5, joint_angles: grad}"),
              HasSubstr("joint_angles: 'grad' is unknown; did you mean 'rad'? One of: rad, deg"));
}

TEST(PoseReadingTest, GripperFromBaseIsInverted) {
  const Rigid3d pose(ExpRotation({0.1, 0.2, 0.3}), {1, 2, 3});
  PoseReading reading;
  EXPECT_THAT(BaseFromGripper(reading, pose), IsNearPose(pose, 1e-12, 1e-12));
  reading.is_base_from_gripper = false;
  EXPECT_THAT(BaseFromGripper(reading, pose), IsNearPose(Inverse(pose), 1e-12, 1e-12));
}

// A folder of three images, which are never opened here, with poses that differ in x.
class CaptureSectionTest : public testing::Test {
 protected:
  CaptureSectionTest() {
    for (const char* name : {"2.png", "10.png", "1.png"}) Write(std::string("images/") + name, "x");
    Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\n1.png,1,0,0,0,0,0,1\n2.png,2,0,0,0,0,0,1\n10.png,10,0,0,0,0,0,1\n");
  }
  void Write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }
  // Reads a section from a file in the folder.
  CaptureSection Read(const std::string& section) const {
    const ConfigValue value = ParseYaml(section, folder_ / "cell.yaml");
    return ReadCaptures(ConfigValue(value.node(), value.file(), "captures"));
  }
  std::string ErrorOf(const std::string& section) const {
    return InputErrorOf([&] { Read(section); });
  }
  static std::vector<std::string> NamesOf(const CaptureSection& section) {
    std::vector<std::string> names;
    for (const Recording& capture : section.captures) names.push_back(capture.name);
    return names;
  }
  static std::vector<double> XsOf(const CaptureSection& section) {
    std::vector<double> xs;
    for (const Recording& capture : section.captures) xs.push_back(capture.base_from_gripper[0].translation.x());
    return xs;
  }
  static std::vector<std::string> LeftOutOf(const CaptureSection& section) {
    std::vector<std::string> entries;
    for (const LeftOutImages& left_out : section.left_out) entries.push_back(left_out.name + ": " + left_out.reason);
    return entries;
  }

  TempFolder folder_;
};

TEST_F(CaptureSectionTest, RowsNameTheirImages) {
  Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\n10.png,10,0,0,0,0,0,1\n1.png,1,0,0,0,0,0,1\n2.png,2,0,0,0,0,0,1\n");
  const CaptureSection section = Read("{images: images, poses: poses.csv}");
  EXPECT_THAT(NamesOf(section), ElementsAre("10.png", "1.png", "2.png"));
  EXPECT_THAT(XsOf(section), ElementsAre(10, 1, 2));
  EXPECT_EQ(section.captures[1].images[0], folder_ / "images/1.png");
  EXPECT_EQ(section.arm.file, folder_ / "poses.csv");
  ASSERT_THAT(section.arm.numbers, SizeIs(3));
  EXPECT_THAT(section.arm.numbers[0], ElementsAre(10, 0, 0, 0, 0, 0, 1));
}

TEST_F(CaptureSectionTest, AColumnOfTimesStatesTheOrder) {
  Write("poses.csv",
        "image,time,x,y,z,qx,qy,qz,qw\n1.png,30,1,0,0,0,0,0,1\n2.png,10,2,0,0,0,0,0,1\n10.png,20,10,0,0,0,0,0,1\n");
  const CaptureSection section = Read("{images: images, poses: poses.csv}");
  EXPECT_THAT(NamesOf(section), ElementsAre("2.png", "10.png", "1.png"));
  EXPECT_THAT(XsOf(section), ElementsAre(2, 10, 1));
  EXPECT_FALSE(section.stream);
}

TEST_F(CaptureSectionTest, PosesAreTakenFromAStreamAtTheTimesOfTheImages) {
  Write("robot.csv", "time,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n4,8,0,0,0,0,0,1\n4,8,0,0,0,0,0,1\n8,16,0,0,0,0,0,1\n");
  // 10.png was taken after the last row.
  const CaptureSection by_names = Read("{images: images, stream: robot.csv}");
  EXPECT_THAT(NamesOf(by_names), ElementsAre("1.png", "2.png"));
  EXPECT_THAT(XsOf(by_names), ElementsAre(DoubleNear(2, 1e-9), DoubleNear(4, 1e-9)));
  EXPECT_THAT(LeftOutOf(by_names), ElementsAre("10.png: the stream of the robot's poses does not reach its time"));
  ASSERT_TRUE(by_names.stream);
  EXPECT_THAT(by_names.stream->times_s, ElementsAre(0, 4, 8));
  Write("times.csv", "image,time\n10.png,1000\n2.png,7\n1.png,3\n");
  const CaptureSection listed = Read("{images: images, poses: times.csv, stream: robot.csv}");
  EXPECT_THAT(NamesOf(listed), ElementsAre("1.png", "2.png"));
  EXPECT_THAT(XsOf(listed), ElementsAre(DoubleNear(6, 1e-9), DoubleNear(14, 1e-9)));
}

// The pose at the time of an image lies between those of the joints beside it.
TEST_F(CaptureSectionTest, AStreamMayHaveJoints) {
  Write("joints.csv",
        "time,j1,j2,j3,j4,j5,j6\n0,0,-1,1,0,1,0\n1,0.02,-1,1,0,1,0\n2,0.04,-1,1,0,1,0\n3,0.06,-1,1,0,1,0\n");
  Write("half/1.5.png", "x");
  Write("half/2.0.png", "x");
  const CaptureSection section = Read("{images: half, stream: joints.csv, pose_format: joints, robot: ur5e}");
  const std::vector<Rigid3d>& of_stream = section.stream->base_from_gripper;
  EXPECT_THAT(section.captures[1].base_from_gripper[0], IsNearPose(of_stream[2], 1e-12, 1e-12));
  EXPECT_THAT(section.captures[0].base_from_gripper[0],
              IsNearPose(Rigid3d(ExpRotation({0, 0, 0.01}), {0, 0, 0}) * of_stream[1], 1e-6, 1e-6));
}

TEST_F(CaptureSectionTest, TimesInNamesMayHaveFractionsOrOtherUnits) {
  for (const char* name : {"t/img_1700000001.5.png", "t/frame2-1700000002500000000.png", "t/1700000003500.png"}) {
    Write(name, "x");
  }
  Write("robot.csv", "time,x,y,z,qx,qy,qz,qw\n1700000000,0,0,0,0,0,0,1\n1700000010,10,0,0,0,0,0,1\n");
  EXPECT_THAT(XsOf(Read("{images: t, stream: robot.csv}")),
              ElementsAre(DoubleNear(1.5, 1e-5), DoubleNear(2.5, 1e-5), DoubleNear(3.5, 1e-5)));
}

TEST_F(CaptureSectionTest, RefusesStreamsWithoutTimes) {
  const std::string stream = "{images: images, stream: robot.csv}";
  Write("robot.csv", "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n");
  EXPECT_THAT(ErrorOf(stream), HasSubstr("robot.csv: has no column 'time'"));
  Write("robot.csv", "time,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n");
  EXPECT_THAT(ErrorOf(stream), HasSubstr("robot.csv: has one time only"));
  Write("robot.csv", "time,x,y,z,qx,qy,qz,qw\n100,0,0,0,0,0,0,1\n101,0,0,0,0,0,0,1\n");
  EXPECT_THAT(ErrorOf(stream), HasSubstr("no image was taken within its times, 100 to 101 s"));
  Write("n/home.png", "x");
  EXPECT_THAT(ErrorOf("{images: n, stream: robot.csv}"), HasSubstr("the image home.png has no time in its name"));
}

// Numbers in names are compared by value, so 10.png is the last image.
TEST_F(CaptureSectionTest, RowsWithoutNamesFollowTheImagesInTheirOrder) {
  Write("poses.csv", "x,y,z,qx,qy,qz,qw\n1,0,0,0,0,0,1\n2,0,0,0,0,0,1\n10,0,0,0,0,0,1\n");
  for (const char* images : {"images", "images/*.png"}) {
    const CaptureSection section = Read(std::string("{images: '") + images + "', poses: poses.csv}");
    EXPECT_THAT(NamesOf(section), ElementsAre("1.png", "2.png", "10.png")) << images;
    EXPECT_THAT(XsOf(section), ElementsAre(1, 2, 10)) << images;
  }
}

TEST_F(CaptureSectionTest, AListKeepsItsOrder) {
  Write("poses.csv", "x,y,z,qx,qy,qz,qw\n1,0,0,0,0,0,1\n2,0,0,0,0,0,1\n");
  const CaptureSection section = Read("{images: [images/10.png, images/1.png], poses: poses.csv}");
  EXPECT_THAT(NamesOf(section), ElementsAre("10.png", "1.png"));
  EXPECT_THAT(XsOf(section), ElementsAre(1, 2));
}

TEST_F(CaptureSectionTest, RolesAndDirectionsAreRead) {
  Write("poses.csv", "image,x,y,z,qx,qy,qz,qw,role\n1.png,1,0,0,0,0,0,1,home\n2.png,2,0,0,0,0,0,1,rotate\n");
  const CaptureSection section = Read("{images: images, poses: poses.csv, poses_are: gripper_from_base}");
  EXPECT_THAT(XsOf(section), ElementsAre(-1, -2));
  EXPECT_EQ(section.captures[0].role, CaptureRole::kHome);
  EXPECT_EQ(section.captures[1].role, CaptureRole::kRotate);
}

TEST_F(CaptureSectionTest, SaysWhyImagesAndRowsAreLeftOut) {
  Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\n1.png,1,0,0,0,0,0,1\n10.png,2,0,0,0,0,0,1\ngone.png,3,0,0,0,0,0,1\n");
  const CaptureSection section = Read("{images: images, poses: poses.csv, exclude: [10.png]}");
  EXPECT_THAT(NamesOf(section), ElementsAre("1.png"));
  EXPECT_THAT(LeftOutOf(section),
              ElementsAre("gone.png: the image is not among those of captures.images",
                          "2.png: the robot's pose is not in the poses file", "10.png: left out by captures.exclude"));
}

// A row whose image has a similar name is a typing error, not a removed image.
TEST_F(CaptureSectionTest, ARowWithASimilarImageNameIsAnError) {
  Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\n1.png,1,0,0,0,0,0,1\n2.pgn,2,0,0,0,0,0,1\n");
  EXPECT_THAT(ErrorOf("{images: images, poses: poses.csv}"),
              HasSubstr("poses.csv:3: the image 2.pgn is not among those of captures.images; did you mean '2.png'?"));
}

TEST_F(CaptureSectionTest, RefusesRowsThatAllNameOtherImages) {
  Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\nleft.jpg,1,0,0,0,0,0,1\nright.jpg,2,0,0,0,0,0,1\n");
  EXPECT_THAT(ErrorOf("{images: images, poses: poses.csv}"),
              HasSubstr("poses.csv:2: the image left.jpg is not among those of captures.images; nor is that of any "
                        "other row"));
}

TEST_F(CaptureSectionTest, RefusesAnImageWithTwoPoses) {
  for (const char* name : {"1.txt", "1.TXT", "2.txt"}) Write(std::string("poses/") + name, "1 0 0 0 0 0 1\n");
  EXPECT_THAT(ErrorOf("{images: images, poses: poses}"), HasSubstr("poses: 1 and 1 both belong to the image 1.png"));
}

TEST_F(CaptureSectionTest, RefusesTwoImagesOfOneName) {
  Write("more/1.png", "x");
  EXPECT_THAT(ErrorOf("{images: [images/1.png, more/1.png], poses: poses.csv}"),
              HasSubstr("captures.images: two images are named 1.png"));
}

TEST_F(CaptureSectionTest, CountsOfRowsWithoutNamesMustAgree) {
  Write("poses.csv", "x,y,z,qx,qy,qz,qw\n1,0,0,0,0,0,1\n2,0,0,0,0,0,1\n");
  EXPECT_THAT(ErrorOf("{images: images, poses: poses.csv}"),
              HasSubstr("poses.csv: has 2 rows without an image column for 3 images; the counts must agree"));
}

// The numbers of some images count the rows from 0 if one of them is 0, and from 1 if one is the number of rows.
TEST_F(CaptureSectionTest, FewerImagesThanRowsArePairedByTheirNumbers) {
  struct Case {
    std::vector<int> numbers;
    std::vector<double> x_m;  // The poses of the images have these x; it is empty if the numbers do not tell.
  };
  for (const Case& test :
       {Case{{0, 2}, {10, 12}}, Case{{0, 3}, {10, 13}}, Case{{2, 4}, {11, 13}}, Case{{1, 3}, {}}, Case{{0, 4}, {}}}) {
    std::filesystem::remove_all(folder_ / "some");
    for (const int number : test.numbers) Write("some/frame_" + std::to_string(number) + ".png", "x");
    Write("poses.csv", "x,y,z,qx,qy,qz,qw\n10,0,0,0,0,0,1\n11,0,0,0,0,0,1\n12,0,0,0,0,0,1\n13,0,0,0,0,0,1\n");
    if (test.x_m.empty()) {
      EXPECT_THAT(ErrorOf("{images: some, poses: poses.csv}"), HasSubstr("the counts must agree"));
      continue;
    }
    EXPECT_EQ(XsOf(Read("{images: some, poses: poses.csv}")), test.x_m);
  }
}

TEST_F(CaptureSectionTest, FilesOfOnePoseArePairedByTheirNamesWithoutSuffix) {
  for (const char* number : {"1", "2", "10"}) {
    Write(std::string("poses/") + number + ".txt", std::string(number) + " 0 0 0 0 0 1\n");
  }
  const CaptureSection section = Read("{images: images, poses: poses}");
  EXPECT_THAT(NamesOf(section), ElementsAre("1.png", "2.png", "10.png"));
  EXPECT_THAT(XsOf(section), ElementsAre(1, 2, 10));
  EXPECT_THAT(section.data_files, SizeIs(4));  // The folder is one of them.
}

TEST_F(CaptureSectionTest, FilesOfOnePoseArePairedByNumbersIfTheirNamesDiffer) {
  for (const char* number : {"01", "02", "10"}) {
    Write(std::string("poses/pose_") + number + ".txt", std::string(number) + " 0 0 0 0 0 1\n");
  }
  EXPECT_THAT(XsOf(Read("{images: images, poses: poses}")), ElementsAre(1, 2, 10));
  Write("images/left.png", "x");
  EXPECT_THAT(ErrorOf("{images: images, poses: poses}"),
              HasSubstr("its files and the images cannot be paired by their names or by single numbers in them"));
}

TEST_F(CaptureSectionTest, TargetPosesReplaceImages) {
  Write("seen.csv", "x,y,z,qx,qy,qz,qw\n0,0,0.5,0,0,0,1\n0,0,0.6,0,0,0,1\n");
  Write("robot.csv", "x,y,z,qx,qy,qz,qw\n1,0,0,0,0,0,1\n2,0,0,0,0,0,1\n");
  const CaptureSection section = Read("{target_poses: seen.csv, poses: robot.csv}");
  EXPECT_THAT(NamesOf(section), ElementsAre("sample_0", "sample_1"));
  EXPECT_THAT(XsOf(section), ElementsAre(1, 2));
  ASSERT_THAT(section.target_poses, SizeIs(2));
  EXPECT_DOUBLE_EQ(section.target_poses[1].translation.z(), 0.6);
  EXPECT_TRUE(section.captures[0].images[0].empty());
  EXPECT_THAT(section.data_files, ElementsAre(folder_ / "seen.csv", folder_ / "robot.csv"));
  EXPECT_EQ(section.detections_source, (folder_ / "seen.csv").string());
}

TEST_F(CaptureSectionTest, DetectionsReplaceImages) {
  Write("detections.json",
        R"({"captures": [{"image": "2.png", "image_size": [640, 480], "ids": [0, 3], "pixels": [[1, 2], [3, 4]]}]})");
  Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\n2.png,2,0,0,0,0,0,1\n");
  const CaptureSection section = Read("{detections: detections.json, poses: poses.csv}");
  EXPECT_THAT(NamesOf(section), ElementsAre("2.png"));
  ASSERT_THAT(section.given_detections, SizeIs(1));
  EXPECT_THAT(section.given_detections[0].detection.detection.ids, ElementsAre(0, 3));
}

TEST_F(CaptureSectionTest, RecordsOfPointsReplaceImages) {
  Write("log.json", R"([{"image": "2.png", "corners": [[1, 2], [3, 4]]}, {"image": "3.png", "corners": null}])");
  Write("poses.csv", "image,x,y,z,qx,qy,qz,qw\n2.png,2,0,0,0,0,0,1\n3.png,3,0,0,0,0,0,1\n");
  const CaptureSection section =
      Read("{detections: {file: log.json, pixels: '[].corners', image: '[].image'}, poses: poses.csv}");
  EXPECT_THAT(NamesOf(section), ElementsAre("2.png", "3.png"));
  ASSERT_THAT(section.given_detections, SizeIs(2));
  EXPECT_THAT(section.given_detections[0].detection.detection.ids, ElementsAre(0, 1));
  EXPECT_TRUE(section.are_points_in_order);
  EXPECT_EQ(section.used["detections"]["pixels"].as<std::string>(), "[].corners");
}

// The poses of another project's data set are in the form of `ros` once they are imported.
TEST_F(CaptureSectionTest, DataSetsBringTheirPoses) {
  Write("set/poses.txt", "1305031102.1 1 0 0 0 0 0 1\n1305031102.2 2 0 0 0 0 0 1\n");
  Write("set/images/a.png", "x");
  Write("set/images/b.png", "x");
  const CaptureSection section = Read("{data: set/poses.txt}");
  ASSERT_TRUE(section.imported.has_value());
  EXPECT_EQ(section.imported->format, "tum");
  EXPECT_THAT(NamesOf(section), ElementsAre("a.png", "b.png"));
  EXPECT_THAT(XsOf(section), ElementsAre(1, 2));
  EXPECT_TRUE(section.arm.file.empty());
  EXPECT_EQ(section.arm.reading.format.name, "ros");
}

TEST_F(CaptureSectionTest, ADataSetWithoutImagesOrDetectionsIsRefused) {
  Write("set/poses.txt", "1305031102.1 1 0 0 0 0 0 1\n");
  EXPECT_THAT(ErrorOf("{data: set/poses.txt}"),
              HasSubstr("captures.data: neither images nor corners nor poses of the target belong to these poses"));
}

TEST_F(CaptureSectionTest, StatesTheSectionAsUsed) {
  const YAML::Node used = Read("{images: images, poses: poses.csv, exclude: [2.png]}").used;
  EXPECT_EQ(used["images"].as<std::string>(), (folder_ / "images").string());
  EXPECT_EQ(used["poses"].as<std::string>(), (folder_ / "poses.csv").string());
  EXPECT_EQ(used["pose_format"].as<std::string>(), "ros");
  EXPECT_EQ(used["poses_are"].as<std::string>(), "base_from_gripper");
  EXPECT_EQ(used["exclude"][0].as<std::string>(), "2.png");
}

struct WrongSection {
  std::string name;
  std::string section;
  std::string message;
};

class WrongSectionTest : public CaptureSectionTest, public testing::WithParamInterface<WrongSection> {};

TEST_P(WrongSectionTest, IsRefusedWithItsKey) {
  Write("empty/notes.txt", "x");
  EXPECT_THAT(ErrorOf(GetParam().section), HasSubstr("cell.yaml:1: captures" + GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    , WrongSectionTest,
    testing::Values(
        WrongSection{"UnknownKey", "{images: images, poses: poses.csv, pose_fromat: ros}",
                     ": unknown key 'pose_fromat'; did you mean 'pose_format'?"},
        WrongSection{"NoImages", "{poses: poses.csv}", ": 'images' is missing"},
        WrongSection{"NoPoses", "{images: images}", ": 'poses' is missing"},
        WrongSection{"TwoSources", "{images: images, detections: detections.json, poses: poses.csv}",
                     ".detections: cannot be combined with 'images'"},
        WrongSection{"MissingFolder", "{images: imges, poses: poses.csv}", ".images: there is no folder "},
        WrongSection{"FolderWithoutImages", "{images: empty, poses: poses.csv}", ".images: the folder "},
        WrongSection{"GlobWithoutMatch", "{images: 'images/*.jpg', poses: poses.csv}", ".images: no file matches "},
        WrongSection{"MissingImage", "{images: [images/3.png], poses: poses.csv}", ".images[0]: there is no image "},
        WrongSection{"EmptyList", "{images: [], poses: poses.csv}", ".images: the list is empty; images are needed"},
        WrongSection{"UnknownExcluded", "{images: images, poses: poses.csv, exclude: [12.png]}",
                     ".exclude[0]: there is no capture '12.png'; did you mean "},
        WrongSection{"AllExcluded", "{images: images, poses: poses.csv, exclude: [1.png, 2.png, 10.png]}",
                     ".images: no capture is left: captures.exclude leaves all of them out"}),
    [](const auto& wrong) { return wrong.param.name; });

}  // namespace
}  // namespace heba
