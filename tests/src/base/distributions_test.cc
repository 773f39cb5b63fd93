#include "heba/base/distributions.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace heba
