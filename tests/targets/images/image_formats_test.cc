// Compares the decoders and encoders with those of OpenCV: on made files of all kinds, and on all files at hand.
#include <algorithm>
#include <filesystem>
#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "heba/base/files.h"
#include "targets/images/image_codecs.h"
#include "targets/images/image_format.h"
#include "tests/support/data_sets.h"
#include "tests/support/opencv_version.h"
#include "tests/targets/images/made_images.h"

namespace heba {
namespace {

namespace fs = std::filesystem;

bool IsSame(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

void ExpectSamePixels(const std::string& name, const std::string& bytes) {
  const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));  // NOLINT
  const cv::Mat expected = cv::imdecode(buffer, cv::IMREAD_UNCHANGED);
  ASSERT_FALSE(expected.empty()) << name << ": OpenCV does not read it";
  const Outcome<cv::Mat> image = DecodeImage(bytes);
  ASSERT_TRUE(image) << name << ": " << image.reason();
  ASSERT_EQ(image->type(), expected.type()) << name;
  ASSERT_EQ(image->size(), expected.size()) << name;
  EXPECT_TRUE(IsSame(*image, expected)) << name;
}

std::vector<MadeImage> AllMadeImages() {
  std::vector<MadeImage> images;
  for (const auto make : {&MadePngs, &MadeJpegs, &MadeTiffs, &MadeBmps, &MadePnms}) {
    const std::vector<MadeImage> more = make();
    images.insert(images.end(), more.begin(), more.end());
  }
  return images;
}

TEST(ImageFormatsTest, MadeImagesEqualOpenCv) {
  const std::vector<MadeImage> images = AllMadeImages();
  for (const MadeImage& image : images) {
    if (!image.is_read_as_by_opencv_4_6 || IsOpenCvBefore(4, 7)) ExpectSamePixels(image.name, image.bytes);
  }
  std::cout << images.size() << " made images\n";
}

TEST(ImageFormatsTest, ThreadsDecodeTheSamePixels) {
  const std::vector<MadeImage> images = AllMadeImages();
  constexpr size_t kNumThreads = 4;
  std::vector<std::future<std::vector<cv::Mat>>> threads;
  for (size_t thread = 0; thread < kNumThreads; ++thread) {
    threads.push_back(std::async(std::launch::async, [&images, thread] {
      std::vector<cv::Mat> decoded(images.size());
      for (size_t i = 0; i < images.size(); ++i) {
        // Each thread begins elsewhere, so that different formats meet.
        const size_t at = (i + thread * images.size() / kNumThreads) % images.size();
        const Outcome<cv::Mat> image = DecodeImage(images[at].bytes);
        if (image) decoded[at] = *image;
      }
      return decoded;
    }));
  }
  const std::vector<cv::Mat> first = threads[0].get();
  for (size_t thread = 1; thread < kNumThreads; ++thread) {
    const std::vector<cv::Mat> other = threads[thread].get();
    for (size_t i = 0; i < images.size(); ++i) EXPECT_TRUE(IsSame(other[i], first[i])) << images[i].name;
  }
}

// Compares the images in a folder, in the order of their paths, each or one of `step`.
void ExpectSamePixelsIn(const fs::path& folder, size_t step = 1) {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file() && HasImageSuffix(entry.path())) paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  int num_images = 0;
  for (size_t i = 0; i < paths.size(); i += step) {
    const std::string bytes = ReadTextFile(paths[i]);
    if (!ReadImageHeader(bytes)) continue;
    ExpectSamePixels(paths[i].string(), bytes);
    ++num_images;
  }
  std::cout << num_images << " images in " << folder << "\n";
}

TEST(ImageFormatsTest, ImagesOfTheRepositoryEqualOpenCv) {
  for (const char* folder : {"configs", "docs", "tests"}) ExpectSamePixelsIn(fs::path(HEBA_SOURCE_DIR) / folder);
}

TEST(ImageFormatsTest, SomeRecordedImagesEqualOpenCv) {
  HEBA_SKIP_WITHOUT(DataDir());
  ExpectSamePixelsIn(DataDir(), 16);
}

TEST(ImageFormatsNightly, AllRecordedImagesEqualOpenCv) {
  HEBA_SKIP_WITHOUT(DataDir());
  ExpectSamePixelsIn(DataDir());
}

// A camera model belongs to the sensor. OpenCV turns images of TIFF.
TEST(ImageFormatsTest, OrientationOfTiffIsNotApplied) {
  cv::Mat first;
  for (const MadeImage& image : TurnedTiffs()) {
    const Outcome<cv::Mat> turned = DecodeImage(image.bytes);
    ASSERT_TRUE(turned) << image.name << ": " << turned.reason();
    if (image.name.ends_with("orientation 1")) first = *turned;
    EXPECT_TRUE(IsSame(*turned, first)) << image.name;
  }
}

// Files are cut where something of the picture is missing. A TIFF whose palette, at its end, is missing is one in grey.
TEST(ImageFormatsTest, TruncatedImagesAreRefused) {
  for (const MadeImage& image : AllMadeImages()) {
    if (image.name.starts_with("tiff palette")) continue;
    for (const double share : {0.02, 0.3, 0.6, 0.8}) {
      const auto size = static_cast<size_t>(share * static_cast<double>(image.bytes.size()));
      EXPECT_FALSE(DecodeImage(image.bytes.substr(0, size))) << image.name << " " << share;
    }
  }
}

TEST(ImageFormatsTest, EncodedFilesEqualThoseOfOpenCv) {
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3, CV_16UC4}) {
    cv::Mat image(43, 57, type);
    cv::randu(image, 0, CV_MAT_DEPTH(type) == CV_8U ? 256 : 65536);
    image.rowRange(10, 30).setTo(cv::Scalar::all(200));
    std::vector<uchar> expected;
    cv::imencode(".png", image, expected);
    Outcome<std::vector<unsigned char>> bytes = EncodeImage(".png", image);
    ASSERT_TRUE(bytes) << bytes.reason();
    EXPECT_EQ(*bytes, expected) << type;
    if (image.depth() != CV_8U) continue;
    for (const int quality : {0, 30, 60, 95, 100}) {
      cv::imencode(".jpg", image, expected, {cv::IMWRITE_JPEG_QUALITY, quality});
      bytes = EncodeJpeg(image, quality);
      ASSERT_TRUE(bytes) << bytes.reason();
      EXPECT_EQ(*bytes, expected) << type << " " << quality;
    }
  }
}

}  // namespace
}  // namespace heba
