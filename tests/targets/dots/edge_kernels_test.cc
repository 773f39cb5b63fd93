// Tests of the kernels of dots and rings: their derivatives against finite differences, with every instruction set.
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "heba/base/rng.h"
#include "targets/dots/blurred_ellipse.h"
#include "targets/dots/ring_image.h"
#include "tests/support/simd_sets.h"

namespace heba {
namespace {

using EdgeKernelTest = EverySimdTest;

// Expects that twice `gradient` is the derivative of `cost`: the gradient of a sum of squares is 2 J'Wr.
template <class Vector, class Cost>
void ExpectGradient(const Vector& at, const Vector& gradient, int num_free, const Cost& cost) {
  constexpr double kStep = 1e-6;
  for (int k = 0; k < num_free; ++k) {
    Vector high = at;
    Vector low = at;
    high[k] += kStep;
    low[k] -= kStep;
    const double numeric = (cost(high) - cost(low)) / (2 * kStep);
    EXPECT_NEAR(2 * gradient[k], numeric, 1e-5 * (1 + std::abs(numeric))) << "parameter " << k;
  }
}

TEST_P(EdgeKernelTest, BlurredEllipseGradientMatchesDifferences) {
  BlurredEllipseParameters x;
  x << 0.05, -0.03, 1.1, 0.15, 0.9, std::log(0.12), 0.9, 0.1, 0.05, -0.04, 0.02, 0.03;
  EdgePixels pixels;
  Rng rng(5, 0);
  // The number of pixels does not fill the SIMD lanes.
  for (int i = 0; i < 301; ++i) {
    const Eigen::Vector2d at{rng.Uniform(-1.4, 1.4), rng.Uniform(-1.4, 1.4)};
    pixels.Add(at.x(), at.y(), rng.Uniform(0, 1));
  }
  pixels.Pad();
  pixels.SetWeight(7, 0);
  for (const double bend : {0.2, 1e9}) {
    const auto cost = [&](const BlurredEllipseParameters& at) {
      return SumEdge(pixels, at, kNumBlurredEllipseParameters, bend).cost;
    };
    const BlurredEllipseSums sums = SumEdge(pixels, x, kNumBlurredEllipseParameters, bend);
    ExpectGradient(x, sums.gradient, kNumBlurredEllipseParameters, cost);
    EXPECT_LT((sums.normal - sums.normal.transpose()).norm(), 1e-12 * sums.normal.norm());
  }
  // The cost is that of the residuals.
  double squares = 0;
  const std::vector<double> residuals = EdgeResiduals(pixels, x);
  ASSERT_EQ(residuals.size(), pixels.size());
  for (size_t i = 0; i < residuals.size(); ++i) squares += i == 7 ? 0 : residuals[i] * residuals[i];
  EXPECT_NEAR(SumEdge(pixels, x, kNumBlurredEllipseParameters, 1e9).cost, squares, 1e-9 * squares);
  // Parameters that are not free have no gradient and a unit row in the normal equations.
  constexpr int kFree = 10;
  const BlurredEllipseSums held = SumEdge(pixels, x, kFree, 1e9);
  EXPECT_EQ(held.gradient[kFree], 0);
  EXPECT_EQ(held.normal(kFree, kFree), 1);
  EXPECT_EQ(held.normal(kFree, 0), 0);
}

TEST_P(EdgeKernelTest, RingGradientMatchesDifferences) {
  const RingWord word = {0b001011010110, 12};
  RingMap map;
  map.ring_from_place = Eigen::Matrix3d::Identity();
  map.ring_from_place(2, 0) = 0.02;
  for (Eigen::Matrix3d& derivative : map.derivatives) derivative.setZero();
  map.sigma = 0.1;
  std::vector<RingPixel> places;
  Rng rng(6, 0);
  for (int i = 0; i < 203; ++i) {
    const double angle = rng.Uniform(0, 2 * M_PI);
    const double radius = rng.Uniform(1.2, 3.4);
    places.push_back({{radius * std::cos(angle), radius * std::sin(angle)}, rng.Uniform(40, 200)});
  }
  const RingPixels pixels(places, 1, map.ring_from_place, word);
  EXPECT_EQ(pixels.size(), places.size());
  RingParameters x;
  x << 0, 0, 0, 1.02, 200, -150, 0.01, -0.02;
  constexpr double kUnit = 100;
  for (const double bend : {0.2, 1e9}) {
    const RingSums sums = SumRing(pixels, map, x, kUnit, bend);
    // Only parameters on which the map does not depend are tested; the caller supplies the derivatives of the map by
    // the others.
    for (int k = kRingScale; k < kNumRingParameters; ++k) {
      const double step = 1e-6 * std::max(1.0, std::abs(x[k]));
      RingParameters high = x;
      RingParameters low = x;
      high[k] += step;
      low[k] -= step;
      const double numeric =
          (SumRing(pixels, map, high, kUnit, bend).cost - SumRing(pixels, map, low, kUnit, bend).cost) / (2 * step);
      EXPECT_NEAR(2 * sums.gradient[k], numeric, 1e-4 * (1 + std::abs(numeric))) << "parameter " << k;
    }
  }
  EXPECT_EQ(RingResiduals(pixels, map, x).size(), places.size());
}

INSTANTIATE_TEST_SUITE_P(Sets, EdgeKernelTest, EverySimd(), SimdName);

}  // namespace
}  // namespace heba
