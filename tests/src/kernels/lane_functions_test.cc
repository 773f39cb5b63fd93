#include "heba/kernels/lane_functions.h"

#include <cmath>

#include <gtest/gtest.h>

namespace heba {
namespace {

using Pair = Lanes<2>;

TEST(LaneFunctionsTest, ExpMatchesTheStandardLibrary) {
  for (double x = -699; x < 700; x += 0.37) {
    EXPECT_NEAR(ExpLanes(x) / std::exp(x), 1, 1e-11) << x;
    const Pair pair = ExpLanes(Pair{x, -x});
    EXPECT_EQ(pair[0], ExpLanes(x));
    EXPECT_EQ(pair[1], ExpLanes(-x));
  }
  EXPECT_LT(ExpLanes(-1e9), 1e-300);
}

TEST(LaneFunctionsTest, NormalMatchesErfc) {
  for (double x = -12; x < 12; x += 0.0137) {
    const NormalLanes<double> normal = NormalOf(x);
    EXPECT_NEAR(normal.cdf, 0.5 * std::erfc(-x * M_SQRT1_2), 1e-11) << x;
    EXPECT_NEAR(normal.density, std::exp(-0.5 * x * x) / std::sqrt(2 * M_PI), 1e-11) << x;
    EXPECT_EQ(NormalOf(Pair{0, x}).cdf[1], normal.cdf);
  }
  EXPECT_NEAR(NormalOf(-1e300).cdf, 0, 1e-200);
  EXPECT_EQ(NormalOf(1e300).cdf, 1);
}

TEST(LaneFunctionsTest, MaximumAbsAndSqrtAreCorrect) {
  EXPECT_EQ(LargestLane(Pair{3, 7}), 7);
  EXPECT_EQ(LargestLane(-2.0), -2);
  EXPECT_EQ(AbsLanes(Pair{-3, 7})[0], 3);
  EXPECT_EQ(SqrtLanes(Pair{4, 9})[1], 3);
}

}  // namespace
}  // namespace heba
