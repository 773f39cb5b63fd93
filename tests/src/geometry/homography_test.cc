// Tests of heba/geometry/homography.h.
#include "heba/geometry/homography.h"

#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/rng.h"

namespace heba {
namespace {

Eigen::Matrix3d TrueHomography() {
  Eigen::Matrix3d truth;
  truth << 900, 120, 640, -80, 950, 480, 0.4, -0.3, 1;
  return truth;
}

// A grid of points, in metres.
std::vector<Eigen::Vector2d> Grid(int rows, int columns) {
  std::vector<Eigen::Vector2d> points;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) points.emplace_back(0.1 * column, 0.1 * row);
  }
  return points;
}

std::vector<Eigen::Vector2d> Mapped(const std::vector<Eigen::Vector2d>& points, double noise_px) {
  Rng rng(3);
  std::vector<Eigen::Vector2d> mapped;
  for (const Eigen::Vector2d& point : points) {
    mapped.push_back(ApplyHomography(TrueHomography(), point) + noise_px * Eigen::Vector2d{rng.Normal(), rng.Normal()});
  }
  return mapped;
}

Eigen::Matrix2Xd Columns(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Matrix2Xd columns(2, points.size());
  for (size_t i = 0; i < points.size(); ++i) columns.col(static_cast<Eigen::Index>(i)) = points[i];
  return columns;
}

double SquaredDistances(const Eigen::Matrix3d& homography, const std::vector<Eigen::Vector2d>& from,
                        const std::vector<Eigen::Vector2d>& to) {
  double sum = 0;
  for (size_t i = 0; i < from.size(); ++i) sum += (ApplyHomography(homography, from[i]) - to[i]).squaredNorm();
  return sum;
}

TEST(HomographyTest, IsExactWithoutNoise) {
  for (const int rows : {2, 5}) {
    const std::vector<Eigen::Vector2d> from = Grid(rows, rows);
    const std::vector<Eigen::Vector2d> to = Mapped(from, 0);
    const std::optional<Eigen::Matrix3d> linear = LinearHomography(Columns(from), Columns(to));
    const std::optional<Eigen::Matrix3d> fitted = FitHomography(from, to);
    ASSERT_TRUE(linear && fitted) << rows;
    EXPECT_LT(SquaredDistances(*linear, from, to), 1e-16) << rows;
    EXPECT_LT(SquaredDistances(*fitted, from, to), 1e-16) << rows;
    EXPECT_LT((*fitted / (*fitted)(2, 2) - TrueHomography()).cwiseAbs().maxCoeff(), 1e-7) << rows;
  }
}

TEST(HomographyTest, MinimisesTheDistances) {
  const std::vector<Eigen::Vector2d> from = Grid(4, 6);
  const std::vector<Eigen::Vector2d> to = Mapped(from, 2.0);
  const std::optional<Eigen::Matrix3d> linear = LinearHomography(Columns(from), Columns(to));
  const std::optional<Eigen::Matrix3d> fitted = FitHomography(from, to);
  ASSERT_TRUE(linear && fitted);
  const double least = SquaredDistances(*fitted, from, to);
  EXPECT_LT(least, SquaredDistances(*linear, from, to));
  // A small change of any element increases the distances, by as much in either direction.
  for (Eigen::Index k = 0; k < 8; ++k) {
    Eigen::Matrix3d more = *fitted / (*fitted)(2, 2);
    Eigen::Matrix3d less = more;
    const double change = 1e-4 * std::abs(more.data()[k]);
    more.data()[k] += change;
    less.data()[k] -= change;
    const double by_more = SquaredDistances(more, from, to) - least;
    const double by_less = SquaredDistances(less, from, to) - least;
    EXPECT_GT(by_more, 0) << k;
    EXPECT_NEAR(by_less / by_more, 1, 0.01) << k;
  }
}

TEST(HomographyTest, ReturnsNothingForDegeneratePoints) {
  const std::vector<Eigen::Vector2d> grid = Grid(3, 3);
  const std::vector<Eigen::Vector2d> to = Mapped(grid, 0);
  const std::vector<Eigen::Vector2d> line = Grid(1, 9);
  EXPECT_FALSE(FitHomography({grid.begin(), grid.begin() + 3}, {to.begin(), to.begin() + 3}).has_value());
  EXPECT_FALSE(FitHomography(line, to).has_value());
  EXPECT_FALSE(FitHomography(grid, line).has_value());
  // Three points on a line and one beside it.
  EXPECT_FALSE(FitHomography({grid[0], grid[1], grid[2], grid[4]}, {to[0], to[1], to[2], to[4]}).has_value());
  std::vector<Eigen::Vector2d> broken = to;
  broken[4].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(FitHomography(grid, broken).has_value());
}

}  // namespace
}  // namespace heba
