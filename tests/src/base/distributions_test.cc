#include "heba/base/distributions.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "heba/base/rng.h"

namespace heba {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The tails have closed forms for chi-square with 2 and 4 degrees of freedom, and for F with (2, n).
TEST(DistributionsTest, TailsMatchClosedForms) {
  for (const double x : {0.01, 0.5, 1.0, 3.0, 10.0, 60.0}) {
    EXPECT_NEAR(ChiSquareTail(x, 2) / std::exp(-x / 2), 1, 1e-12) << x;
    EXPECT_NEAR(ChiSquareTail(x, 4) / (std::exp(-x / 2) * (1 + x / 2)), 1, 1e-11) << x;
    for (const double n : {3.0, 17.0, 400.0}) {
      EXPECT_NEAR(FisherTail(x, 2, n) / std::pow(1 + 2 * x / n, -n / 2), 1, 1e-10) << x << " " << n;
    }
  }
}

// The expected values are those of printed tables (95 % and 99.9 %), compared to their last digit.
TEST(DistributionsTest, QuantilesMatchTables) {
  EXPECT_NEAR(ChiSquareQuantile(0.05, 6), 12.592, 5e-4);
  EXPECT_NEAR(ChiSquareQuantile(0.001, 12), 32.909, 5e-4);
  EXPECT_NEAR(FisherQuantile(0.05, 6, 20), 2.599, 5e-4);
  EXPECT_NEAR(FisherQuantile(0.05, 6, kInfinity), 12.592 / 6, 1e-4);
}

TEST(DistributionsTest, QuantilesInvertTails) {
  for (const double tail : {1e-6, 1e-3, 0.3, 0.9}) {
    EXPECT_NEAR(ChiSquareTail(ChiSquareQuantile(tail, 7), 7) / tail, 1, 1e-9);
    EXPECT_NEAR(FisherTail(FisherQuantile(tail, 6, 31), 6, 31) / tail, 1, 1e-9);
  }
}

// The distance along one axis is Student's t, and that of an isotropic point is known from Fisher's F.
TEST(DistributionsTest, ConfidenceRadiusMatchesTables) {
  Eigen::Matrix3d along_x = Eigen::Matrix3d::Zero();
  along_x(0, 0) = 4;
  EXPECT_NEAR(ConfidenceRadius(along_x, 0.95, kInfinity), 2 * 1.960, 2e-3);
  EXPECT_NEAR(ConfidenceRadius(along_x, 0.95, 10), 2 * 2.228, 2e-3);
  EXPECT_NEAR(ConfidenceRadius(along_x, 0.95, 4), 2 * 2.776, 2e-3);
  EXPECT_NEAR(ConfidenceRadius(Eigen::Matrix3d::Identity(), 0.95, 10), std::sqrt(3 * 3.708), 1e-3);
  EXPECT_EQ(ConfidenceRadius(Eigen::Matrix3d::Zero(), 0.95, 10), 0);
}

// The size of the covariance is drawn anew in each of 20,000 draws: the share inside is known to 0.002, and the
// approximation for unequal axes is good to 0.01.
TEST(DistributionsTest, ConfidenceRadiusHoldsItsShareOfPoints) {
  constexpr int kDraws = 20000;
  constexpr int kDof = 6;
  const Eigen::Vector3d sigmas(1, 2, 4);
  const Eigen::Matrix3d covariance = sigmas.cwiseAbs2().asDiagonal();
  const double unit_radius = ConfidenceRadius(covariance, 0.95, kDof);
  Rng rng(1);
  int num_inside = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    double squares = 0;
    for (int i = 0; i < kDof; ++i) squares += std::pow(rng.Normal(), 2);
    const double stated_sigma = std::sqrt(squares / kDof);
    num_inside += sigmas.cwiseProduct(rng.NormalVector3()).norm() < stated_sigma * unit_radius ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(num_inside) / kDraws, 0.95, 0.01);
}

}  // namespace
}  // namespace heba
