#include "tools/pipeline/image_quality.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "heba/geometry/rigid3.h"

namespace heba {
namespace {
using ::testing::HasSubstr;

constexpr int kSquarePx = 24;

// Returns a chessboard that is blurred with this sigma along x and along y.
cv::Mat Board(double along_x_px, double along_y_px) {
  cv::Mat image(10 * kSquarePx, 10 * kSquarePx, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const bool is_dark = (u / kSquarePx + v / kSquarePx) % 2 == 0;
      image.at<unsigned char>(v, u) = is_dark ? 40 : 200;
    }
  }
  cv::GaussianBlur(image, image, cv::Size(0, 0), along_x_px, along_y_px);
  return image;
}

std::vector<Eigen::Vector2d> Corners() {
  std::vector<Eigen::Vector2d> corners;
  for (int i = 1; i < 10; ++i) {
    for (int k = 1; k < 10; ++k) corners.emplace_back(kSquarePx * i - 0.5, kSquarePx * k - 0.5);
  }
  return corners;
}

TEST(BlurPxTest, IsThatOfTheEdges) {
  for (const double sigma_px : {1.0, 1.5, 2.5}) {
    EXPECT_NEAR(*BlurPx(Board(sigma_px, sigma_px), Corners()), sigma_px, 0.2 * sigma_px);
  }
}

// An arm that moves blurs the edges across its motion alone.
TEST(BlurPxTest, MotionBlurCounts) {
  const double still_px = *BlurPx(Board(0.8, 0.8), Corners());
  for (const cv::Mat& moved : {Board(3, 0.8), Board(0.8, 3)}) {
    const double moved_px = *BlurPx(moved, Corners());
    EXPECT_GT(moved_px, 2);
    EXPECT_THAT(SharpnessText(moved_px, still_px), HasSubstr("blurred: its edges have a sigma of "));
  }
  EXPECT_EQ(SharpnessText(still_px, still_px), "");
}

TEST(BlurPxTest, FaintImagesAndPointsAtTheBorderTellNothing) {
  EXPECT_FALSE(BlurPx(cv::Mat(240, 240, CV_8UC1, cv::Scalar(100)), Corners()).has_value());
  EXPECT_FALSE(BlurPx(Board(1, 1), {{2, 2}, {3, 200}, {238, 100}, {100, 239}}).has_value());
}

TEST(ExposureTextTest, NamesDarkAndOverexposedImages) {
  EXPECT_EQ(ExposureText(Board(1, 1)), "");
  EXPECT_THAT(ExposureText(cv::Mat(10, 10, CV_8UC1, cv::Scalar(8))), HasSubstr("dark: its mean is 8 of 255"));
  EXPECT_THAT(ExposureText(cv::Mat(10, 10, CV_8UC1, cv::Scalar(255))),
              HasSubstr("overexposed: 100 % of its pixels are white"));
}

// Returns a square target of 100 mm in an image of 1000 x 1000 px, tilted about its y axis.
SeenTarget Seen(const Eigen::Vector2d& middle_px, double tilt_rad, double px_per_m = 2000) {
  SeenTarget seen{{}, 1000, 1000};
  Observations& observations = seen.observations;
  observations.points_in_target.resize(3, 9);
  observations.pixels.resize(2, 9);
  for (int i = 0; i < 9; ++i) {
    observations.ids.push_back(i);
    const Eigen::Vector3d at_m(0.05 * (i % 3 - 1), 0.05 * (i / 3 - 1), 0);
    observations.points_in_target.col(i) = at_m;
    observations.pixels.col(i) = middle_px + px_per_m * Eigen::Vector2d(std::cos(tilt_rad) * at_m.x(), at_m.y());
  }
  return seen;
}

TEST(GaugesTest, AreSharesOfAGoodSession) {
  const Gauges one = GaugesOf({Seen({500, 500}, 0)});
  EXPECT_EQ(one.x, 0);
  EXPECT_EQ(one.y, 0);
  EXPECT_EQ(one.size, 0);
  EXPECT_NEAR(one.skew, 0, 1e-6);
  const Gauges moved = GaugesOf({Seen({300, 500}, 0), Seen({500, 500}, 0), Seen({550, 500}, 0, 3000)});
  EXPECT_NEAR(moved.x, 0.5, 1e-9);
  EXPECT_NEAR(moved.y, 0, 1e-9);
  EXPECT_NEAR(moved.size, 0.4, 1e-9);
  EXPECT_NEAR(GaugesOf({Seen({500, 500}, std::acos(0.9))}).skew, 0.5, 1e-6);
  EXPECT_EQ(GaugesOf({Seen({500, 500}, 1.2)}).skew, 1);
  EXPECT_EQ(GaugesOf({}).x, 0);
}

}  // namespace
}  // namespace heba
