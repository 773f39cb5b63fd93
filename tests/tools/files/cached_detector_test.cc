// Tests of tools/files/cached_detector.h.
#include "tools/files/cached_detector.h"

#include <cstdlib>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "tests/support/input_error.h"
#include "tests/support/temp_folder.h"
#include "tools/run/digest.h"

namespace heba {
namespace {
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr const char* kTarget = "{type: chessboard, rows: 3, columns: 4, square: 20 mm}";

class CachedDetectorTest : public testing::Test {
 protected:
  CachedDetectorTest() {
    setenv("HEBA_CACHE", (folder_ / "cache").c_str(), 1);
    cv::imwrite((folder_ / "empty.png").string(), cv::Mat(48, 64, CV_8UC1, cv::Scalar(128)));
  }
  TempFolder folder_;
};

TEST_F(CachedDetectorTest, StatesTheDigestAndTheSizeOfTheImage) {
  const CaptureDetection detection = CachedDetector(kTarget).Detect(folder_ / "empty.png", std::nullopt);
  EXPECT_EQ(detection.image_digest, DigestOfFile(folder_ / "empty.png"));
  EXPECT_EQ(detection.width_px, 64);
  EXPECT_EQ(detection.height_px, 48);
  EXPECT_THAT(detection.detection.ids, SizeIs(0));
}

// An image is searched once, even if another detector searches it for a target of another size.
TEST_F(CachedDetectorTest, DetectionsAreKeptIndependentlyOfTheTargetsSize) {
  const CachedDetector first(kTarget);
  EXPECT_FALSE(first.has_kept());
  first.Detect(folder_ / "empty.png", std::nullopt);
  EXPECT_TRUE(first.has_kept());
  const CachedDetector larger("{type: chessboard, rows: 3, columns: 4, square: 25 mm}");
  larger.Detect(folder_ / "empty.png", std::nullopt);
  EXPECT_FALSE(larger.has_kept());
  const CachedDetector other("{type: chessboard, rows: 3, columns: 5, square: 20 mm}");
  other.Detect(folder_ / "empty.png", std::nullopt);
  EXPECT_TRUE(other.has_kept());
}

TEST_F(CachedDetectorTest, RefusesAnImageOfAnotherSize) {
  EXPECT_THAT(InputErrorOf([&] {
                CachedDetector(kTarget).Detect(folder_ / "empty.png", ImageSize{64, 64});
              }),
              HasSubstr("empty.png"));
  EXPECT_THAT(InputErrorOf([&] { CachedDetector(kTarget).Detect(folder_ / "absent.png", std::nullopt); }),
              HasSubstr("absent.png: cannot be read"));
}

}  // namespace
}  // namespace heba
