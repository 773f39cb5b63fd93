// Tests of the functions that the readers of other projects' data sets share.
#include "heba/io/import_text.h"

#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/units.h"
#include "tests/support/input_error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;

class ImportTextTest : public testing::Test {
 protected:
  fs::path Write(const std::string& name, const std::string& text = "x") const {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  TempFolder folder_;
};

TEST(NumbersOfLineTest, AcceptsEverySeparator) {
  EXPECT_THAT(NumbersOfLine(" 1, 2;3\t-4.5e1 \r", "a.txt", 1), ElementsAre(1, 2, 3, -45));
  EXPECT_THAT(NumbersOfLine("", "a.txt", 1), IsEmpty());
}

TEST(NumbersOfLineTest, NamesFileLineAndField) {
  EXPECT_EQ(InputErrorOf([] { NumbersOfLine("1 two 3", "a.txt", 7); }), "a.txt:7: 'two' is not a finite number");
  EXPECT_EQ(InputErrorOf([] { NumbersOfLine("1 nan", "a.txt", 7); }), "a.txt:7: 'nan' is not a finite number");
}

TEST(LinesOfTest, CommentsAndEmptyLinesAreLeftOut) {
  const std::vector<TextLine> lines = LinesOf("# title\n\n  1 2 # end\r\n\t\n3");
  ASSERT_THAT(lines, SizeIs(2));
  EXPECT_EQ(lines[0].text, "1 2");
  EXPECT_EQ(lines[0].number, 3);
  EXPECT_EQ(lines[1].text, "3");
  EXPECT_EQ(lines[1].number, 5);
}

// The first line decides which format a file has, so it must not throw for any file.
TEST_F(ImportTextTest, CountsTheNumbersOfTheFirstLine) {
  EXPECT_EQ(NumbersInFirstLine(Write("a.txt", "# time x y z\n\n1 2 3 4\n5\n")), 4u);
  EXPECT_EQ(NumbersInFirstLine(Write("b.txt", "x y z\n1 2 3\n")), 0u);
  EXPECT_EQ(NumbersInFirstLine(Write("c.txt", "")), 0u);
  EXPECT_EQ(NumbersInFirstLine(folder_ / "absent.txt"), 0u);
  EXPECT_EQ(NumbersInFirstLine(folder_.path()), 0u);
}

TEST(FlatNumbersTest, ListsMayHoldLists) {
  EXPECT_THAT(FlatNumbers(ParseYaml("[[1, 2], 3, [4]]", "a.yaml")), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(InputErrorOf([] { FlatNumbers(ParseYaml("[[1, b]]", "a.yaml")); }), HasSubstr("a.yaml:1"));
}

TEST(PoseOfTest, StatesTheNumbersOfAPose) {
  EXPECT_THAT(PoseOf("ur", std::vector<double>{1, 2, 3, 0, 0, kPi / 2}, "a.txt"),
              IsNearPose(Rigid3d(ExpRotation({0, 0, kPi / 2}), {1, 2, 3}), 1e-9, 1e-12));
  EXPECT_EQ(InputErrorOf([] {
              PoseOf("ur", std::vector<double>{1, 2, 3}, "a.txt");
            }),
            "a.txt: 3 numbers; a pose has 6: x, y, z, rx, ry, rz");
}

TEST(PoseOfTest, AMatrixIsInItsUnit) {
  const std::vector<double> matrix = {1, 0, 0, 100, 0, 1, 0, 200, 0, 0, 1, 300, 0, 0, 0, 1};
  EXPECT_THAT(PoseOfMatrix(matrix, 1e-3, "a.txt"),
              IsNearPose(Rigid3d(Eigen::Quaterniond::Identity(), {0.1, 0.2, 0.3}), 1e-9, 1e-12));
}

TEST(PoseOfTest, MappingsAreReadByTheirKeys) {
  const Rigid3d pose(ExpRotation({0, 0, kPi}), {1, 2, 3});
  EXPECT_THAT(PoseOfMap(ParseYaml("{qw: 0, qz: 1, qy: 0, qx: 0, z: 3, y: 2, x: 1, time: 5}", "a.yaml")),
              IsNearPose(pose, 1e-9, 1e-12));
  EXPECT_THAT(
      PoseOfTransform(ParseYaml("{rotation: {w: 0, x: 0, y: 0, z: 1}, translation: {z: 3, x: 1, y: 2}}", "a.yaml")),
      IsNearPose(pose, 1e-9, 1e-12));
  EXPECT_THAT(InputErrorOf([] { PoseOfMap(ParseYaml("{x: 1, y: 2}", "a.yaml")); }), HasSubstr("'z' is missing"));
}

// The numbers count, not the letters: 2 comes before 10.
TEST_F(ImportTextTest, NumberedFilesAreSortedByTheirNumbers) {
  for (const char* name : {"pose10.yaml", "pose2.yaml", "pose.yaml", "pose1.txt", "xpose3.yaml", "posea.yaml"}) {
    Write(name);
  }
  fs::create_directory(folder_ / "pose7.yaml");
  EXPECT_THAT(NumberedFiles(folder_.path(), {"pose"}, {".yaml"}),
              ElementsAre(Pair(2, folder_ / "pose2.yaml"), Pair(10, folder_ / "pose10.yaml")));
  EXPECT_THAT(NumberedFiles(folder_ / "absent", {"pose"}, {".yaml"}), IsEmpty());
}

TEST_F(ImportTextTest, TheKindThatIsListedFirstIsUsed) {
  for (const char* name : {"img1.jpg", "img1.png", "image1.png", "image2.jpg"}) Write(name);
  EXPECT_THAT(NumberedFiles(folder_.path(), {"img", "image"}, {".png", ".jpg"}),
              ElementsAre(Pair(1, folder_ / "img1.png"), Pair(2, folder_ / "image2.jpg")));
}

TEST_F(ImportTextTest, TwoFilesOfOneKindWithOneNumberAreAnError) {
  Write("pose1.yaml");
  Write("pose01.yaml");
  EXPECT_THAT(InputErrorOf([&] { NumberedFiles(folder_.path(), {"pose"}, {".yaml"}); }),
              HasSubstr(".yaml: has the same number as pose"));
}

TEST_F(ImportTextTest, ImagesAreSortedByTheNumbersInTheirNames) {
  for (const char* name : {"10.png", "9.JPG", "notes.txt", "1.tiff"}) Write(name);
  fs::create_directory(folder_ / "5.png");
  EXPECT_THAT(ImagesOf(folder_.path()), ElementsAre(folder_ / "1.tiff", folder_ / "9.JPG", folder_ / "10.png"));
  EXPECT_THAT(ImagesOf(folder_ / "absent"), IsEmpty());
}

TEST_F(ImportTextTest, TheFirstFolderWithImagesIsUsed) {
  Write("rgb/1.png");
  Write("rgb/2.png");
  const auto [images, remarks] = ImagesForPoses({folder_ / "images", folder_ / "rgb"}, 2);
  EXPECT_THAT(images, SizeIs(2));
  EXPECT_THAT(remarks, IsEmpty());
}

// Images are not assigned to poses by guessing.
TEST_F(ImportTextTest, RemarksThatImagesAndPosesDiffer) {
  Write("images/1.png");
  Write("rgb/1.png");
  Write("rgb/2.png");
  const auto [images, remarks] = ImagesForPoses({folder_ / "images", folder_ / "rgb"}, 2);
  EXPECT_THAT(images, IsEmpty());
  EXPECT_THAT(remarks, ElementsAre("1 images are beside the 2 poses; the file does not state which belong together"));
}

TEST(CaptureOfTest, ACaptureIsNamedAfterItsImageOrNumber) {
  EXPECT_EQ(CaptureOf(fs::path("images/a.png"), 3).name, "a.png");
  EXPECT_EQ(CaptureOf(fs::path(), 3).name, "pose_3");
  const std::map<int, fs::path> images = {{3, "images/c.png"}};
  EXPECT_EQ(CaptureOf(images, 3).name, "c.png");
  EXPECT_EQ(CaptureOf(images, 4).name, "pose_4");
  EXPECT_TRUE(CaptureOf(images, 4).image.empty());
}

TEST_F(ImportTextTest, TheBeginningOfAFileIsLimited) {
  EXPECT_EQ(BeginningOf(Write("short.txt", "short")), "short");
  EXPECT_EQ(BeginningOf(Write("long.txt", std::string(20000, 'x'))).size(), 8192u);
  EXPECT_EQ(BeginningOf(folder_ / "absent.txt"), "");
  EXPECT_EQ(BeginningOf(folder_.path()), "");
}

TEST_F(ImportTextTest, ReadsMatricesAndNumbersOfAFileStorage) {
  const fs::path file = Write("a.yml",
                              "%YAML:1.0\n---\nframeCount: 2\nname: cell\nT: !!opencv-matrix\n   rows: 1\n   cols: 3\n"
                              "   dt: d\n   data: [ 1., 2., 3. ]\n");
  EXPECT_THAT(FileStorageNumbers(file),
              ElementsAre(Pair("T", ElementsAre(1, 2, 3)), Pair("frameCount", ElementsAre(2))));
}

TEST(ChessboardYamlTest, IsATargetFile) {
  EXPECT_EQ(ChessboardYaml(6, 8, 0.0158), "type: chessboard\nrows: 6\ncolumns: 8\nsquare: 0.0158 m\n");
}

}  // namespace
}  // namespace heba
