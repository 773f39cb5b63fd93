// Tests of the kernel of pattern fits: its Jacobian columns against finite differences, for every form of the map and
// every instruction set, and the state that it keeps from one evaluation to the next.
#include "targets/corners/pattern_rows.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "heba/base/rng.h"
#include "tests/support/simd_sets.h"

namespace heba {
namespace {

constexpr double kLeastSquares = std::numeric_limits<double>::infinity();

// A pattern of eight by eight cells over the unit square, with 15 px per cell.
struct Scene {
  CellPattern pattern;
  PatternMap map;
  PatternParams params = PatternParams::Zero();
  std::vector<PatternPixels::Pixel> pixels;

  explicit Scene(MapForm form) {
    Rng rng(3, 0);
    constexpr int kCells = 8;
    for (int k = 1; k < kCells; ++k) {
      pattern.x_m.push_back(-1 + 2.0 * k / kCells);
      pattern.y_m.push_back(-1 + 2.0 * k / kCells);
    }
    pattern.albedo.resize(kCells, kCells);
    for (Eigen::Index i = 0; i < pattern.albedo.size(); ++i) pattern.albedo.data()[i] = rng.Uniform(0, 1) < 0.5 ? 0 : 1;
    map.form = form;
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> start;
    start << 60, 8, 200, -6, 55, 150, 0.02, -0.03, 1;
    std::copy_n(start.data(), start.size(), &map.start[0][0]);
    map.middle_px[0] = 200;
    map.middle_px[1] = 150;
    map.size_px = 60;
    map.lens_px[0] = 320;
    map.lens_px[1] = 240;
    map.lens_radius_px = 400;
    for (const int k : SoughtParams(form, true)) params[k] = 0.2 * rng.Uniform(-1, 1);
    params[kBlack] = 30;
    params[kWhite] = 190;
    params[kBlur] = 1.1;
    for (int k = kLight; k < kStretch; ++k) params[k] *= 0.1;
    params.segment<2>(kStretch) = Eigen::Vector2d(-0.2, 0.5);
    if (form == MapForm::kAffine || form == MapForm::kQuadratic) params.segment<3>(kLightBend).setZero();
    for (int v = 85; v < 215; v += 3) {
      for (int u = 130; u < 270; u += 2) {
        const Eigen::Vector2d unit = (start.inverse() * Eigen::Vector3d(u, v, 1)).hnormalized();
        if (unit.cwiseAbs().maxCoeff() > 0.97) continue;
        pixels.push_back({static_cast<double>(u), static_cast<double>(v), rng.Uniform(40, 200), unit.x(), unit.y()});
      }
    }
  }

  PatternRows Rows() const {
    PatternRows rows(pattern, Eigen::Vector2d::Zero(), Eigen::Vector2d::Ones());
    rows.SetPixels(PatternPixels(pixels, {map.middle_px[0], map.middle_px[1]}, 60));
    return rows;
  }
  PatternSums SumAt(const PatternParams& at, double huber_grey, PatternColumns columns = {true, false}) const {
    PatternRows rows = Rows();
    const std::optional<PatternSums> sums = rows.Sum(map, at, huber_grey, columns);
    EXPECT_TRUE(sums.has_value());
    return sums.value_or(PatternSums());
  }
};

constexpr MapForm kForms[] = {MapForm::kAffine, MapForm::kQuadratic, MapForm::kLens, MapForm::kPolynomial};

using PatternRowsTest = EverySimdTest;

// The residuals are differentiated numerically, pixel by pixel. The kernel evaluates the terms of the map at the
// pixel and not at the line whose blur reaches it, which changes a column by a few per cent.
TEST_P(PatternRowsTest, ColumnsAreDerivativesOfTheResiduals) {
  for (const MapForm form : kForms) {
    const Scene scene(form);
    const std::vector<int> sought = SoughtParams(form, true);
    const auto n = static_cast<Eigen::Index>(sought.size());
    const auto num_pixels = static_cast<Eigen::Index>(scene.pixels.size());
    ASSERT_GT(num_pixels, 1000);
    // One kernel for all, so that the lines within reach of a pixel are the same.
    PatternRows kernel = scene.Rows();
    const auto residuals_at = [&](const PatternParams& at) {
      const std::vector<double> residuals = kernel.Sum(scene.map, at, kLeastSquares, {true, false})->residuals;
      return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(residuals.data(), num_pixels));
    };
    Eigen::MatrixXd rows(num_pixels, n + 1);
    rows.col(n) = residuals_at(scene.params);
    for (Eigen::Index k = 0; k < n; ++k) {
      const int param = sought[static_cast<size_t>(k)];
      const double step = param < kLight ? 1e-4 : 1e-5;
      PatternParams high = scene.params;
      PatternParams low = scene.params;
      high[param] += step;
      low[param] -= step;
      rows.col(k) = (residuals_at(high) - residuals_at(low)) / (2 * step);
    }
    const PatternSums sums = scene.SumAt(scene.params, kLeastSquares);
    const Eigen::MatrixXd expected = rows.transpose() * rows;
    EXPECT_NEAR(sums.cost, 0.5 * expected(n, n), 1e-9 * sums.cost);
    const Eigen::VectorXd scale = expected.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd difference = scale.asDiagonal() * (sums.products - expected) * scale.asDiagonal();
    EXPECT_LT(difference.cwiseAbs().maxCoeff(), 0.03) << "form " << static_cast<int>(form);
    // The columns of shifts, levels, blur and light are exact.
    for (Eigen::Index k = 0; k < n; ++k) {
      const int param = sought[static_cast<size_t>(k)];
      if (param != 0 && param != 3 && param < kBlack) continue;
      EXPECT_NEAR(difference(k, k), 0, 2e-3) << "form " << static_cast<int>(form) << ", parameter " << param;
    }
  }
}

TEST_P(PatternRowsTest, AppliesTheHuberThreshold) {
  const Scene scene(MapForm::kLens);
  const PatternSums plain = scene.SumAt(scene.params, kLeastSquares);
  constexpr double kHuberGrey = 50;
  double cost = 0;
  double weighted_squares = 0;
  int num_beyond = 0;
  for (const double residual : plain.residuals) {
    const double size = std::abs(residual);
    num_beyond += size > kHuberGrey ? 1 : 0;
    cost += size > kHuberGrey ? kHuberGrey * (size - 0.5 * kHuberGrey) : 0.5 * size * size;
    weighted_squares += std::min(1.0, kHuberGrey / size) * size * size;
  }
  EXPECT_GT(num_beyond, 100);
  const PatternSums robust = scene.SumAt(scene.params, kHuberGrey);
  EXPECT_EQ(robust.residuals, plain.residuals);
  EXPECT_NEAR(robust.cost, cost, 1e-9 * cost);
  const auto residual = static_cast<Eigen::Index>(SoughtParams(MapForm::kLens, true).size());
  EXPECT_NEAR(robust.products(residual, residual), weighted_squares, 1e-9 * weighted_squares);
}

// The additional columns equal those of the map that contains the polynomial.
TEST_P(PatternRowsTest, AddsThePolynomialsColumns) {
  Scene scene(MapForm::kLens);
  const PatternSums both = scene.SumAt(scene.params, kLeastSquares, {true, true});
  const auto num_lens = static_cast<Eigen::Index>(SoughtParams(MapForm::kLens, true).size());
  ASSERT_EQ(both.products.cols(), num_lens + 1 + 2 * PatternMap::kNumPolynomial);
  scene.map.form = MapForm::kPolynomial;
  const PatternSums polynomial = scene.SumAt(scene.params, kLeastSquares);
  const auto num_wide = static_cast<Eigen::Index>(SoughtParams(MapForm::kPolynomial, true).size());
  for (Eigen::Index k = 0; k < 2 * PatternMap::kNumPolynomial; ++k) {
    const Eigen::Index own = PatternMap::kNumAffine + k;
    const double size = std::sqrt(polynomial.products(own, own) * polynomial.products(num_wide, num_wide));
    EXPECT_NEAR(both.products(num_lens + 1 + k, num_lens), polynomial.products(own, num_wide), 1e-6 * size) << k;
  }
}

// The lines within reach of a pixel are searched for again only occasionally; the sums must equal those of a new
// kernel.
TEST_P(PatternRowsTest, SumsDoNotDependOnEarlierEvaluations) {
  for (const MapForm form : kForms) {
    const Scene scene(form);
    PatternRows rows = scene.Rows();
    PatternParams at = scene.params;
    Rng rng(8, 0);
    for (const double blur_factor : {1.0, 1.08, 0.65, 1.5, 0.7, 1.05}) {
      at[kBlur] *= blur_factor;
      at[0] += 0.4 * rng.Uniform(-1, 1);
      at[3] += 0.4 * rng.Uniform(-1, 1);
      const std::optional<PatternSums> sums = rows.Sum(scene.map, at, kLeastSquares, {true, false});
      ASSERT_TRUE(sums.has_value());
      rows.Keep();
      const PatternSums fresh = scene.SumAt(at, kLeastSquares);
      // A line out of reach has a weight of at most 6e-5.
      EXPECT_NEAR(sums->cost, fresh.cost, 1e-4 * fresh.cost);
      const Eigen::VectorXd scale = fresh.products.diagonal().cwiseSqrt().cwiseInverse();
      const Eigen::MatrixXd difference = scale.asDiagonal() * (sums->products - fresh.products) * scale.asDiagonal();
      EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-3) << "form " << static_cast<int>(form);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, PatternRowsTest, EverySimd(), SimdName);

}  // namespace
}  // namespace heba
