#include "targets/images/image_codecs.h"

#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "targets/images/image_format.h"

namespace heba {
namespace {

using testing::HasSubstr;

cv::Mat Ramp() {
  cv::Mat image(17, 23, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) image.at<uchar>(v, u) = static_cast<uchar>(10 * v + u);
  }
  return image;
}

std::string Bytes(const Outcome<std::vector<unsigned char>>& encoded) {
  EXPECT_TRUE(encoded) << encoded.reason();
  return encoded ? std::string(encoded->begin(), encoded->end()) : std::string();
}

double LargestDifference(const Outcome<cv::Mat>& image, const cv::Mat& expected) {
  EXPECT_TRUE(image) << image.reason();
  if (!image || image->size() != expected.size() || image->type() != expected.type()) return 1e9;
  return cv::norm(*image, expected, cv::NORM_INF);
}

TEST(ImageCodecsTest, ServesSeveralThreadsFromTheStart) {
  std::vector<std::future<double>> differences;
  for (int i = 0; i < 8; ++i) {
    differences.push_back(std::async(
        std::launch::async, [] { return LargestDifference(DecodeImage(Bytes(EncodeImage(".png", Ramp()))), Ramp()); }));
  }
  for (std::future<double>& difference : differences) EXPECT_EQ(difference.get(), 0);
}

TEST(ImageCodecsTest, KeepsDepthAndChannels) {
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1}) {
    cv::Mat image(5, 7, type);
    cv::randu(image, 0, 255);
    EXPECT_EQ(LargestDifference(DecodeImage(Bytes(EncodeImage(".png", image))), image), 0) << type;
  }
}

TEST(ImageCodecsTest, JpegIsSmallerForLessQuality) {
  cv::Mat image(64, 64, CV_8UC1);
  cv::randu(image, 0, 255);
  const std::string good = Bytes(EncodeJpeg(image, 95));
  const std::string poor = Bytes(EncodeJpeg(image, 30));
  EXPECT_LT(2 * poor.size(), good.size());
  EXPECT_LT(LargestDifference(DecodeImage(good), image), 30);
}

TEST(ImageCodecsTest, RefusesWhatItCannotDo) {
  EXPECT_THAT(DecodeImage("no picture").reason(), HasSubstr("not of a format"));
  EXPECT_THAT(DecodeImage("").reason(), HasSubstr("not of a format"));
  EXPECT_THAT(EncodeImage(".unheard-of", Ramp()).reason(), HasSubstr("'.unheard-of'"));
  EXPECT_THAT(EncodeImage("", Ramp()).reason(), HasSubstr("''"));
  EXPECT_THAT(EncodeImage(".png", cv::Mat(3, 3, CV_8UC2)).reason(), HasSubstr("2 channels"));
  EXPECT_THAT(EncodeImage(".png", cv::Mat(3, 3, CV_32FC1)).reason(), HasSubstr("neither 8 nor 16 bits"));
  EXPECT_THAT(EncodeJpeg(cv::Mat(3, 3, CV_16UC1), 90).reason(), HasSubstr("8 bits"));
  EXPECT_THAT(EncodeJpeg(cv::Mat(70000, 1, CV_8UC1), 90).reason(), HasSubstr("65500"));
}

TEST(ImageCodecsTest, NamesFormatsThatAreNotRead) {
  EXPECT_EQ(UnreadFormatName("RIFF\1\2\3\4WEBPVP8 "), "a WebP");
  EXPECT_EQ(UnreadFormatName("GIF89a"), "a GIF");
  EXPECT_EQ(UnreadFormatName(std::string("\0\0\0\x20"
                                         "ftypavif",
                                         12)),
            "an AVIF");
  EXPECT_EQ(UnreadFormatName(std::string("II+\0\x08", 5)), "a BigTIFF");
  EXPECT_EQ(UnreadFormatName("GI"), "");
  EXPECT_EQ(UnreadFormatName(""), "");
  EXPECT_EQ(ImageFormatNames(), "PNG, JPEG, BMP, TIFF, PBM/PGM/PPM");
}

// The libraries print warnings and errors unless they are told not to.
TEST(ImageCodecsTest, PrintsNothing) {
  std::string png = Bytes(EncodeImage(".png", Ramp()));
  png.insert(33, std::string("\0\0\0\4gAMA\0\0\xb1\x8f....", 16));  // A wrong checksum.
  const std::string jpeg = Bytes(EncodeJpeg(Ramp(), 90));
  std::string odd_jpeg = jpeg;
  odd_jpeg.insert(2, "extraneous");
  // A directory with an unknown tag, out of order, and a strip beyond the end.
  std::string tiff("II*\0\x08\0\0\0\x09\0", 10);
  const int entries[][2] = {{256, 4}, {257, 4},    {258, 8}, {259, 1}, {40000, 7},
                            {262, 1}, {273, 9999}, {278, 4}, {279, 16}};
  for (const auto& [tag, value] : entries) {
    tiff += static_cast<char>(tag & 255);
    tiff += static_cast<char>(tag >> 8);
    tiff += std::string("\3\0\1\0\0\0", 6);
    tiff += static_cast<char>(value & 255);
    tiff += static_cast<char>(value >> 8);
    tiff += std::string(2, '\0');
  }
  tiff += std::string(4, '\0');
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  const Outcome<cv::Mat> warned = DecodeImage(png);
  const Outcome<cv::Mat> odd = DecodeImage(odd_jpeg);
  const Outcome<cv::Mat> cut = DecodeImage(jpeg.substr(0, jpeg.size() * 3 / 4));
  const Outcome<cv::Mat> strips = DecodeImage(tiff);
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(LargestDifference(warned, Ramp()), 0);
  EXPECT_THAT(cut.reason(), HasSubstr("truncated"));
  EXPECT_THAT(strips.reason(), HasSubstr("damaged, truncated"));
}

}  // namespace
}  // namespace heba
