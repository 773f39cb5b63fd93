#include "targets/images/image_codecs.h"

#include <future>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

namespace heba {
namespace {

cv::Mat Ramp() {
  cv::Mat image(17, 23, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) image.at<uchar>(v, u) = static_cast<uchar>(10 * v + u);
  }
  return image;
}

cv::Mat AsRow(const std::vector<unsigned char>& bytes) { return cv::Mat(bytes, true).reshape(1, 1); }

double LargestDifference(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() ? cv::norm(a, b, cv::NORM_INF) : 1e9;
}

// This test runs first, so that the library is loaded by whichever thread is the first.
TEST(ImageCodecsTest, ServesSeveralThreadsFromTheStart) {
  std::vector<std::future<double>> differences;
  for (int i = 0; i < 8; ++i) {
    differences.push_back(std::async(
        std::launch::async, [] { return LargestDifference(DecodeImage(AsRow(EncodeImage(".png", Ramp()))), Ramp()); }));
  }
  for (std::future<double>& difference : differences) EXPECT_EQ(difference.get(), 0);
}

TEST(ImageCodecsTest, KeepsDepthAndChannels) {
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1}) {
    cv::Mat image(5, 7, type);
    cv::randu(image, 0, 255);
    EXPECT_EQ(LargestDifference(DecodeImage(AsRow(EncodeImage(".png", image))), image), 0) << type;
  }
}

TEST(ImageCodecsTest, JpegIsSmallerForLessQuality) {
  cv::Mat image(64, 64, CV_8UC1);
  cv::randu(image, 0, 255);
  const std::vector<unsigned char> good = EncodeJpeg(image, 95);
  const std::vector<unsigned char> poor = EncodeJpeg(image, 30);
  EXPECT_LT(2 * poor.size(), good.size());
  EXPECT_LT(LargestDifference(DecodeImage(AsRow(good)), image), 30);
}

TEST(ImageCodecsTest, InvalidImagesAreEmptyAndUnknownSuffixesThrow) {
  EXPECT_TRUE(DecodeImage(AsRow({'n', 'o', ' ', 'p', 'i', 'c', 't', 'u', 'r', 'e'})).empty());
  EXPECT_THROW(EncodeImage(".unheard-of", Ramp()), cv::Exception);
}

}  // namespace
}  // namespace heba
