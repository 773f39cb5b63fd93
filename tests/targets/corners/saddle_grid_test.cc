// Tests of grids of saddle points: targets are found, and images that cannot contain a whole target are given up.
#include "targets/corners/saddle_grid.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "heba/base/units.h"
#include "tests/support/rendered_target.h"

namespace heba {
namespace {

using testing::IsEmpty;
using testing::Lt;

constexpr int kRows = 6;
constexpr int kColumns = 9;
const cv::Size kSize(kColumns, kRows);

std::unique_ptr<Target> Board() { return MakeTarget("{type: chessboard, rows: 6, columns: 9, square: 20 mm}"); }

// Returns the pose of a slightly tilted target that is rotated by `turn_rad` and whose centre is `aside_px` to the
// right of the centre of the image.
Rigid3d BoardPose(double aside_px, double turn_rad) {
  constexpr double kDistanceM = 0.35;
  const Eigen::Quaterniond rotation = ExpRotation({0.3, -0.2, 0}) * ExpRotation({0, 0, turn_rad});
  const Eigen::Vector3d middle_m(0.08, 0.05, 0);
  const double aside_m = aside_px * kDistanceM / ImageCamera().params[0];
  return {rotation, Eigen::Vector3d(aside_m, 0, kDistanceM) - rotation * middle_m};
}

cv::Mat Render(const Target& target, const Rigid3d& camera_from_target, double noise_grey = 2) {
  RenderOptions options;
  options.noise_sigma_grey = noise_grey;
  options.clutter = true;
  return RenderView(target.Draw(), ImageCamera(), camera_from_target, options);
}

int GreyAt(const cv::Mat& grey, const Eigen::Vector2d& pixel) {
  return grey.at<uchar>(static_cast<int>(std::lround(pixel.y())), static_cast<int>(std::lround(pixel.x())));
}

// Expects that the sector between the edges of a saddle and the opposite one are darker than the two others.
void ExpectDarkSectorsBetweenEdges(const cv::Mat& grey, const Saddle& saddle) {
  constexpr double kStepPx = 5;
  constexpr int kMinContrastGrey = 50;
  for (const double sign : {-1.0, 1.0}) {
    const Eigen::Vector2d dark_px = saddle.pixel + sign * kStepPx * (saddle.edges[0] + saddle.edges[1]);
    const Eigen::Vector2d light_px = saddle.pixel + sign * kStepPx * (saddle.edges[0] - saddle.edges[1]);
    EXPECT_LT(GreyAt(grey, dark_px) + kMinContrastGrey, GreyAt(grey, light_px)) << saddle.pixel.transpose();
  }
}

TEST(SaddleGrid, SaddlesHaveTheDarkSectorBetweenTheirEdges) {
  const std::unique_ptr<Target> board = Board();
  const cv::Mat grey = Render(*board, BoardPose(0, 0.4));
  const std::vector<Saddle> saddles = FindSaddles(grey, 1000);
  size_t num_corners = 0;
  for (const TargetPoint& point : board->points()) {
    const Eigen::Vector2d pixel = PixelOf(point, ImageCamera(), BoardPose(0, 0.4)).value();
    for (const Saddle& saddle : saddles) {
      if ((saddle.pixel - pixel).norm() > 0.5) continue;
      ++num_corners;
      ExpectDarkSectorsBetweenEdges(grey, saddle);
    }
  }
  EXPECT_EQ(num_corners, board->points().size());
}

double DistanceToNearestPx(const std::vector<cv::Point2f>& corners, const Eigen::Vector2d& pixel) {
  double nearest_px = 1e9;
  for (const cv::Point2f& corner : corners) {
    nearest_px = std::min(nearest_px, (Eigen::Vector2d(corner.x, corner.y) - pixel).norm());
  }
  return nearest_px;
}

// The parameter is the rotation of the target in the image, in degrees.
class RotatedSaddleGridTest : public testing::TestWithParam<int> {
 protected:
  static double RotationRad() { return GetParam() * kPi / 180; }
};

TEST_P(RotatedSaddleGridTest, IsFound) {
  const std::unique_ptr<Target> board = Board();
  const Rigid3d pose = BoardPose(0, RotationRad());
  const SaddleGrid grid = FindSaddleGrid(Render(*board, pose, /*noise_grey=*/6), kSize);
  ASSERT_EQ(grid.corners.size(), board->points().size());
  for (const TargetPoint& point : board->points()) {
    const Eigen::Vector2d pixel = PixelOf(point, ImageCamera(), pose).value();
    EXPECT_LT(DistanceToNearestPx(grid.corners, pixel), 1) << pixel.transpose();
  }
}

TEST_P(RotatedSaddleGridTest, IsTheLargestOne) {
  const AnySaddleGrid grid = FindLargestSaddleGrid(Render(*Board(), BoardPose(0, RotationRad()), /*noise_grey=*/6));
  EXPECT_EQ(std::max(grid.size.width, grid.size.height), kColumns);
  EXPECT_EQ(std::min(grid.size.width, grid.size.height), kRows);
  EXPECT_EQ(grid.corners.size(), static_cast<size_t>(kSize.area()));
}

// OpenCV's finders take a second or even minutes for such an image, so they must not be called.
TEST_P(RotatedSaddleGridTest, IsGivenUpIfTruncated) {
  const std::unique_ptr<Target> board = Board();
  for (const double aside_px : {390.0, 440.0}) {
    const cv::Mat grey = Render(*board, BoardPose(aside_px, RotationRad()));
    const SaddleGrid grid = FindSaddleGrid(grey, kSize);
    EXPECT_THAT(grid.corners, IsEmpty()) << aside_px;
    EXPECT_TRUE(grid.may_be_in.empty()) << aside_px;
  }
}

INSTANTIATE_TEST_SUITE_P(, RotatedSaddleGridTest, testing::Range(0, 360, 30),
                         [](const auto& test) { return std::to_string(test.param) + "_deg"; });

TEST(SaddleGrid, GivesUpImagesWithoutTarget) {
  const char* const others[] = {"{type: chessboard, rows: 9, columns: 13, square: 13 mm}",
                                "{type: chessboard, rows: 4, columns: 5, square: 30 mm}",
                                "{type: circle_grid, rows: 6, columns: 9, spacing: 20 mm}",
                                "{type: coded_board, rows: 4, columns: 5, spacing: 35 mm, dot_diameter: 10 mm}"};
  for (const char* other : others) {
    const std::unique_ptr<Target> target = MakeTarget(other);
    const SaddleGrid grid = FindSaddleGrid(Render(*target, BoardPose(0, 0.2)), kSize);
    EXPECT_THAT(grid.corners, IsEmpty()) << other;
    EXPECT_TRUE(grid.may_be_in.empty()) << other;
  }
}

// Spots hide the corners of the last columns; the squares around them show that the target continues there.
TEST(SaddleGrid, ReportsWhereAnIncompleteTargetContinues) {
  const std::unique_ptr<Target> board = Board();
  cv::Mat grey = Render(*board, BoardPose(0, 0));
  const auto pixel_of = [&](int row, int column) {
    const size_t index = static_cast<size_t>(row * kColumns + column);
    const Eigen::Vector2d pixel = PixelOf(board->points()[index], ImageCamera(), BoardPose(0, 0)).value();
    return cv::Point(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
  };
  constexpr int kSpotPx = 16;
  for (int row = 0; row < kRows; ++row) {
    for (int column = kColumns - 2; column < kColumns; ++column) {
      const cv::Point corner = pixel_of(row, column);
      grey(cv::Rect(corner.x - kSpotPx / 2, corner.y - kSpotPx / 2, kSpotPx, kSpotPx)) = 120;
    }
  }
  const SaddleGrid grid = FindSaddleGrid(grey, kSize);
  EXPECT_THAT(grid.corners, IsEmpty());
  EXPECT_TRUE(grid.may_be_in.contains(pixel_of(0, 0)));
  EXPECT_TRUE(grid.may_be_in.contains(pixel_of(kRows - 1, kColumns - 1)));
}

// The cost of the search grows with the number of saddle points; noise of any strength causes only few.
TEST(SaddleGrid, NoiseCausesFewSaddles) {
  cv::Mat noise(1000, 1000, CV_8UC1);
  cv::RNG random(27);
  for (const double sigma_grey : {2.0, 5.0, 12.0, 30.0}) {
    random.fill(noise, cv::RNG::NORMAL, 120, sigma_grey);
    EXPECT_THAT(FindSaddles(noise, 10000).size(), Lt(500U)) << sigma_grey;
  }
}

}  // namespace
}  // namespace heba
