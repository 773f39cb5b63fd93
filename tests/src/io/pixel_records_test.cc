#include "heba/io/pixel_records.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heba/base/error.h"
#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class PixelRecordsTest : public testing::Test {
 protected:
  std::vector<PixelRecord> Read(const std::string& name, const std::string& text, const std::string& pixels,
                                const std::string& images) const {
    const fs::path file = folder_ / name;
    std::ofstream(file) << text;
    return ReadPixelRecords(file, pixels, images);
  }
  std::string ErrorOf(const std::string& text, const std::string& pixels, const std::string& images) const {
    return InputErrorOf([&] { Read("wrong.json", text, pixels, images); });
  }
  TempFolder folder_;
};

TEST_F(PixelRecordsTest, ReadsAListOfRecords) {
  const std::vector<PixelRecord> records =
      Read("log.json", R"({"records": [{"image": "shots/a.png", "corners": [[1, 2], [3, 4.5]]},
                                       {"image": "shots/b.png", "corners": null}]})",
           "records[].corners", "records[].image");
  ASSERT_THAT(records, SizeIs(2));
  EXPECT_EQ(records[0].image, "a.png");
  ASSERT_THAT(records[0].pixels, SizeIs(2));
  EXPECT_EQ(records[0].pixels[1], Eigen::Vector2d(3, 4.5));
  EXPECT_EQ(records[1].image, "b.png");
  EXPECT_THAT(records[1].pixels, IsEmpty());
}

// OpenCV's functions return N x 1 x 2.
TEST_F(PixelRecordsTest, ReadsPointsOfAnyNestingBelowTheNamesOfImages) {
  const std::vector<PixelRecord> records =
      Read("log.yaml", "7.png: {seen: [[[1, 2]], [[3, 4]]]}\n8.png: {seen: [5, 6, 7, 8]}\n", "*.seen", "");
  ASSERT_THAT(records, SizeIs(2));
  EXPECT_EQ(records[0].image, "7.png");
  EXPECT_EQ(records[0].pixels[1], Eigen::Vector2d(3, 4));
  EXPECT_EQ(records[1].pixels[0], Eigen::Vector2d(5, 6));
}

TEST_F(PixelRecordsTest, ReadsOneOfSeveralCameras) {
  const std::vector<PixelRecord> records = Read(
      "log.json", R"([{"cameras": [[[1, 2]], [[3, 4]]]}, {"cameras": [[[5, 6]], [[7, 8]]]}])", "[].cameras[1]", "");
  ASSERT_THAT(records, SizeIs(2));
  EXPECT_EQ(records[0].image, "");
  EXPECT_EQ(records[1].pixels[0], Eigen::Vector2d(7, 8));
}

TEST_F(PixelRecordsTest, RefusesWhatIsNotThere) {
  constexpr const char* kText = R"({"records": [{"image": "a.png", "corners": [[1, 2], [3]], "n": 4}]})";
  EXPECT_THAT(ErrorOf(kText, "record[].corners", ""), HasSubstr("leads to nothing at 'record'"));
  EXPECT_THAT(ErrorOf(kText, "records[3].corners", ""), HasSubstr("leads to nothing at '[3]'"));
  EXPECT_THAT(ErrorOf(kText, "records[x].corners", ""), HasSubstr("leads to nothing at '[x]'"));
  EXPECT_THAT(ErrorOf(kText, "records[].corners", ""), HasSubstr("item 1 at 'records[].corners' is not a list of"));
  EXPECT_THAT(ErrorOf(kText, "records[].image", ""), HasSubstr("is not a list of points"));
  constexpr const char* kRight = R"({"records": [{"corners": [[1, 2]]}], "images": ["a.png", "b.png"], "n": [1]})";
  EXPECT_THAT(ErrorOf(kRight, "records[].corners", "images[]"), HasSubstr("1 lists of points at "));
  EXPECT_THAT(ErrorOf(kRight, "records[].corners", "n[]"), HasSubstr("is not the name of an image"));
}

}  // namespace
}  // namespace heba
