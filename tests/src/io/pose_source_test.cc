// Tests of robot poses in the files that users have: tables without a header, NumPy arrays, and folders with one file
// per pose.
#include "heba/io/pose_source.h"
#include "heba/io/pose_folder.h"

#include <algorithm>
#include <cstring>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/io/npy_file.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

void Write(const fs::path& path, const std::string& content) { std::ofstream(path, std::ios::binary) << content; }

PoseFormat FormatOf(const std::string& yaml) { return ReadPoseFormat(ParseYaml(yaml, "cell.yaml")); }

const char* const kOwn = "{columns: [image, '-', x, y, z, a, b, c], translation: mm, rotation: euler_zyx, angle: deg}";
const char* const kPlain = "{columns: [x, y, z, a, b, c], translation: mm, rotation: euler_zyx, angle: deg}";

const std::vector<double> kFirst = {100, -200, 300, 10, 20, 30};
const std::vector<double> kSecond = {110, -210, 310, -15, 25, 35};

// The rows do not depend on how the fields are separated.
TEST(HeaderlessTest, ReadsEverySeparatorAndBrackets) {
  for (const std::string text :
       {"100,-200,300,10,20,30\n110,-210,310,-15,25,35\n", "100;-200;300;10;20;30\n110;-210;310;-15;25;35\n",
        "100\t-200\t300\t10\t20\t30\n110\t-210\t310\t-15\t25\t35\n",
        "  100 -200   300 10 20 30\n110 -210 310\t-15 25 35  \n",
        "# a remark\n\n100 \t -200 \t 300 10 20 30\r\n110 -210 310 -15 25 35\r\n",
        "[100, -200, 300, 10, 20, 30]\n[[110, -210, 310], [-15, 25, 35]]\n",
        "p[100,-200,300,10,20,30]\np[110,-210,310,-15,25,35]",
        "x y z a b c\n100 -200 300 10 20 30\n110 -210 310 -15 25 35"}) {
    const std::vector<PoseRow> rows = ParsePoses(text, "poses.txt", FormatOf(kPlain));
    ASSERT_EQ(rows.size(), 2U) << text;
    EXPECT_EQ(rows[0].numbers, kFirst) << text;
    EXPECT_EQ(rows[1].numbers, kSecond) << text;
    EXPECT_EQ(rows[0].image, "");
  }
}

TEST(HeaderlessTest, ColumnsMayBeImagesOrIgnored) {
  const std::vector<PoseRow> rows =
      ParsePoses("a.png 17.5 100 -200 300 10 20 30\nb.png 18.5 110 -210 310 -15 25 35\n", "poses.txt", FormatOf(kOwn));
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[1].image, "b.png");
  EXPECT_EQ(rows[1].numbers, kSecond);
  EXPECT_EQ(rows[1].line, 2);
  // A header may name more columns than the format.
  EXPECT_EQ(
      ParsePoses("x,y,z,a,b,c,image,time\n100,-200,300,10,20,30,a.png,5\n", "poses.csv", FormatOf(kOwn))[0].numbers,
      kFirst);
}

// Column names decide which number is which, wherever the column is.
TEST(HeaderlessTest, ColumnNamesOverrideTheirPositions) {
  const PoseFormat turns_first =
      FormatOf("{columns: [a, b, c, x, y, z], translation: mm, rotation: euler_zyx, angle: deg}");
  EXPECT_EQ(ParsePoses("10 20 30 100 -200 300\n", "poses.txt", turns_first)[0].numbers, kFirst);
  EXPECT_EQ(ParsePoses("a b c x y z\n10 20 30 100 -200 300\n", "poses.txt", turns_first)[0].numbers, kFirst);
  const PoseFormat w_first =
      FormatOf("{columns: [qw, qx, qy, qz, z, y, x], translation: m, rotation: quaternion_xyzw}");
  EXPECT_EQ(ParsePoses("0 1 0 0 3 2 1\n", "poses.txt", w_first)[0].numbers, (std::vector<double>{1, 2, 3, 1, 0, 0, 0}));
}

// Brackets are part of an image name. The header may give the image column any name.
TEST(HeaderlessTest, ImagesKeepTheirNames) {
  EXPECT_EQ(ParsePoses("img (1).png,7,100,-200,300,10,20,30\n", "poses.txt", FormatOf(kOwn))[0].image, "img (1).png");
  EXPECT_EQ(ParsePoses("file,n,x,y,z,a,b,c\nb.png,7,100,-200,300,10,20,30\n", "poses.txt", FormatOf(kOwn))[0].image,
            "b.png");
}

TEST(HeaderlessTest, ReadsBracketedLists) {
  const std::vector<PoseRow> rows =
      ParsePoses("[\n  [100, -200, 300, 10, 20, 30],\n  [110, -210, 310, -15, 25, 35]  # the last one\n]\n",
                 "poses.txt", FormatOf(kPlain));
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[1].numbers, kSecond);
}

TEST(HeaderlessTest, FaultsNameTheLine) {
  const auto error = [](const std::string& text, const std::string& format) {
    return InputErrorOf([&] { ParsePoses(text, "poses.txt", FormatOf(format)); });
  };
  EXPECT_THAT(error("1 2 3 4 5 6\n1 2 3 4 5\n", kPlain),
              HasSubstr("poses.txt:2: 5 fields, but pose_format has 6 columns"));
  EXPECT_THAT(error("1 2 3 4 5 6\n1 2 3 4 5 six\n", kPlain),
              HasSubstr("poses.txt:2: column 'c': 'six' is not a number"));
  // Built-in formats define their columns by name only, so a header is needed.
  EXPECT_THAT(error("1 2 3 4 5 6\n", "kuka"), HasSubstr("poses.txt:1: the first line must name the columns"));
}

std::string Npy(const std::string& descr, bool is_fortran, const std::string& shape, const std::string& data) {
  std::string header =
      "{'descr': '" + descr + "', 'fortran_order': " + (is_fortran ? "True" : "False") + ", 'shape': " + shape + ", }";
  header.resize(std::max<size_t>(118, header.size() + 1), ' ');
  header.back() = '\n';
  return std::string("\x93NUMPY\x01\x00", 8) + std::string{static_cast<char>(header.size()), 0} + header + data;
}

template <typename Number>
std::string Bytes(const std::vector<double>& numbers) {
  std::string bytes;
  for (const double value : numbers) {
    const auto number = static_cast<Number>(value);
    char one[sizeof(Number)];
    std::memcpy(one, &number, sizeof(Number));
    bytes.append(one, sizeof(Number));
  }
  return bytes;
}

TEST(NpyTest, ReadsTypesAndOrders) {
  const std::vector<double> numbers = {1, 2, 3, 4, 5, 6};
  for (const auto& [descr, bytes] : {std::pair<std::string, std::string>{"<f8", Bytes<double>(numbers)},
                                     {"<f4", Bytes<float>(numbers)},
                                     {"<i8", Bytes<int64_t>(numbers)},
                                     {"<i4", Bytes<int32_t>(numbers)},
                                     {"|u1", Bytes<uint8_t>(numbers)}}) {
    const NumberArray array = ParseNpy(Npy(descr, false, "(2, 3)", bytes), "a.npy");
    EXPECT_EQ(array.shape, (std::vector<size_t>{2, 3})) << descr;
    EXPECT_EQ(array.numbers, numbers) << descr;
  }
  // The array is stored in column-major order: 1 3 5 / 2 4 6.
  EXPECT_EQ(ParseNpy(Npy("<f8", true, "(2, 3)", Bytes<double>(numbers)), "a.npy").numbers,
            (std::vector<double>{1, 3, 5, 2, 4, 6}));
  EXPECT_EQ(ParseNpy(Npy("<f8", false, "(6,)", Bytes<double>(numbers)), "a.npy").numbers, numbers);
}

TEST(NpyTest, SaysWhatIsWrong) {
  const std::string data = Bytes<double>({1, 2, 3, 4, 5, 6});
  const auto error = [](const std::string& bytes) { return InputErrorOf([&] { ParseNpy(bytes, "a.npy"); }); };
  EXPECT_THAT(error(""), HasSubstr("a.npy: is not a NumPy array"));
  EXPECT_THAT(error("x,y,z\n1,2,3\n"), HasSubstr("is not a NumPy array"));
  EXPECT_THAT(error(Npy("<f8", false, "(2, 4)", data)), HasSubstr("is truncated"));
  EXPECT_THAT(error(Npy("<f8", false, "(1000000, 1000000, 1000000)", data)), HasSubstr("is truncated"));
  EXPECT_THAT(error(Npy("<f8", false, "(-2, 3)", data)), HasSubstr("shape"));
  EXPECT_THAT(error(Npy(">f8", false, "(2, 3)", data)), HasSubstr("'>f8'"));
  EXPECT_THAT(error(Npy("<U8", false, "(2, 3)", data)), HasSubstr("'<U8'"));
  EXPECT_THAT(error(Npy("<f8", false, "(2, 3)", data).substr(0, 60)), HasSubstr("is truncated"));
  // Iterating over this many axes would take hours.
  std::string axes;
  for (int i = 0; i < 33; ++i) axes += "1,";
  EXPECT_THAT(error(Npy("<f8", true, "(" + axes + ")", data)), HasSubstr("more than 32 axes"));
  // A truncated file gives an InputError, or an array if that is complete; it never causes a crash.
  const std::string whole = Npy("<f8", false, "(2, 3)", data);
  for (size_t size = 0; size < whole.size(); ++size) EXPECT_NE(error(whole.substr(0, size)), "") << size;
}

class PoseSourceTest : public testing::Test {
 protected:
  TempFolder folder_;
};

TEST_F(PoseSourceTest, ReadsArraysWithOnePosePerRow) {
  const fs::path file = folder_.path() / "poses.npy";
  Write(file, Npy("<f8", false, "(2, 6)", Bytes<double>({100, -200, 300, 10, 20, 30, 110, -210, 310, -15, 25, 35})));
  const std::vector<PoseRow> rows = ReadPoses(file, FormatOf(kPlain));
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[1].numbers, kSecond);
  const std::vector<double> identity = {1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1};
  Write(file, Npy("<f8", false, "(1, 4, 4)", Bytes<double>(identity)));
  EXPECT_EQ(ReadPoses(file, *FindPoseFormat("matrix"))[0].pose.translation, Eigen::Vector3d(5, 6, 7));
  EXPECT_THAT(InputErrorOf([&] { ReadPoses(file, FormatOf(kPlain)); }),
              HasSubstr("array of 1 x 4 x 4; N x 6 is needed"));
}

// A folder may contain one file per pose, in any supported file type; the files are sorted by the number in their
// names.
TEST_F(PoseSourceTest, ReadsFoldersWithOneFilePerPose) {
  Write(folder_.path() / "pose_2.txt", "100 -200 300\n10 20 30\n");
  Write(folder_.path() / "pose_10.json", "{\"x\": 100, \"y\": -200, \"z\": 300, \"c\": 30, \"b\": 20, \"a\": 10}");
  Write(folder_.path() / "pose_9.yaml", "place: [100, -200, 300]\nangles: [10, 20, 30]\n");
  Write(folder_.path() / "pose_11.csv", "x,y,z,a,b,c\n100,-200,300,10,20,30\n");
  Write(folder_.path() / "pose_12.npy", Npy("<f8", false, "(6,)", Bytes<double>(kFirst)));
  Write(folder_.path() / "pose_13.yml",
        "%YAML:1.0\n---\npose: !!opencv-matrix\n   rows: 6\n   cols: 1\n   dt: d\n   data: [ 100., -200., 300., 10., "
        "20., "
        "30. ]\n");
  Write(folder_.path() / "readme.txt", "no pose");
  Write(folder_.path() / "pose_1.png", "no pose either");
  const std::vector<PoseRow> rows = ReadPoses(folder_.path(), FormatOf(kPlain));
  std::vector<std::string> names;
  for (const PoseRow& row : rows) {
    names.push_back(row.image);
    EXPECT_EQ(row.numbers, kFirst) << row.image;
  }
  EXPECT_EQ(names, (std::vector<std::string>{"pose_2", "pose_9", "pose_10", "pose_11", "pose_12", "pose_13"}));
}

// The order of the keys of a mapping has no meaning: keys with known names are read by name, and any other mapping is
// refused.
TEST_F(PoseSourceTest, MappingsAreReadByTheirKeys) {
  const fs::path file = folder_.path() / "pose_1.json";
  const auto numbers_of = [&](const std::string& json, const PoseFormat& format) {
    Write(file, json);
    return ReadPoses(folder_.path(), format)[0].numbers;
  };
  const PoseFormat& ros = *FindPoseFormat("ros");
  const std::vector<double> wanted = {1, 2, 3, 0, 0, 1, 0};
  for (
      const std::string json :
      {R"({"orientation": {"w": 0, "x": 0, "y": 0, "z": 1}, "position": {"x": 1, "y": 2, "z": 3}})",
       R"({"stamp": 17.5, "pose": {"position": {"x": 1, "y": 2, "z": 3}, "orientation": {"x": 0, "y": 0, "z": 1, "w": 0}}})",
       R"({"translation": [1, 2, 3], "rotation": [0, 0, 1, 0]})"}) {
    EXPECT_EQ(numbers_of(json, ros), wanted) << json;
  }
  Write(file, R"({"first": [1, 2, 3], "second": [4, 5, 6]})");
  EXPECT_THAT(InputErrorOf([&] { ReadPoses(folder_.path(), *FindPoseFormat("ur")); }),
              HasSubstr("these numbers cannot be identified"));
  // Angles under the names of another convention are not taken for a rotation vector.
  Write(file, R"({"a": 1, "b": 2, "c": 3, "x": 4, "y": 5, "z": 6})");
  EXPECT_THAT(
      InputErrorOf([&] { ReadPoses(folder_.path(), *FindPoseFormat("ur")); }),
      HasSubstr("no poses of 6 numbers (x, y, z, rx, ry, rz) are in it, but poses (6 numbers: x, y, z, a, b, c)"));
  EXPECT_EQ(ReadPoses(folder_.path(), *FindPoseFormat("kuka")).size(), 1u);
}

// File names may be time stamps in nanoseconds, and files of another type may lie beside the poses.
TEST_F(PoseSourceTest, IgnoresOtherFilesInFolders) {
  Write(folder_.path() / "1690000000123456789.txt", "100 -200 300 10 20 30");
  Write(folder_.path() / "1690000000223456789.txt", "110 -210 310 -15 25 35");
  Write(folder_.path() / "1690000000223456789.json", "{\"exposure\": 10}");
  const std::vector<PoseRow> rows = ReadPoses(folder_.path(), FormatOf(kPlain));
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[1].image, "1690000000223456789");
}

TEST_F(PoseSourceTest, FaultsNameTheFile) {
  const auto error = [&](const std::string& name, const std::string& content) {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_.path())) fs::remove(entry.path());
    if (!name.empty()) Write(folder_.path() / name, content);
    return InputErrorOf([&] { ReadPoses(folder_.path(), FormatOf(kPlain)); });
  };
  EXPECT_THAT(error("", ""), HasSubstr("contains no poses"));
  EXPECT_THAT(error("pose_1.txt", "1 2 3"), HasSubstr("pose_1.txt: 3 numbers; a pose has 6: x, y, z, a, b, c"));
  EXPECT_THAT(error("pose_1.txt", "1 2 3 4 5 f"), HasSubstr("pose_1.txt:1: 'f' is not a finite number"));
  EXPECT_THAT(error("pose_1.yaml", "place: [1, 2, three]"), HasSubstr("pose_1.yaml:1"));
  EXPECT_THAT(error("pose_1.json", "[1, 2, 3, 4, 5"), HasSubstr("pose_1.json"));
  EXPECT_THAT(error("pose_1.npy", "nothing"), HasSubstr("pose_1.npy: is not a NumPy array"));
  EXPECT_THAT(error("pose_1.csv", "x,y,z,a,b,c\n1,2,3,4,5,6\n1,2,3,4,5,6\n"), HasSubstr("contains 2 poses, not one"));
}

TEST(NumberInNameTest, IsTheLastOne) {
  EXPECT_EQ(NumberInName("pose_0007"), 7);
  EXPECT_EQ(NumberInName("cam2_010_rgb"), 10);
  EXPECT_EQ(NumberInName("12"), 12);
  EXPECT_EQ(NumberInName("pose"), std::nullopt);
  EXPECT_EQ(NumberInName("1690000000123456789"), 1690000000123456789);
  EXPECT_EQ(NumberInName("1234567890123456789012345"), std::nullopt);
}

}  // namespace
}  // namespace heba
