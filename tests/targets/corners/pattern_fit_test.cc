#include "targets/corners/pattern_fit.h"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <string>

#include <gtest/gtest.h>
#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "heba/base/factorisation.h"
#include "heba/base/rng.h"
#include "heba/geometry/homography.h"
#include "targets/corners/cell_pattern.h"
#include "targets/corners/pattern_rows.h"
#include "targets/render/rendering.h"
#include "tests/support/simd_sets.h"

namespace heba {
namespace {

// Returns a chessboard with squares of 10 mm around the origin and a small square inside a white square next to the
// origin.
Drawing TestDrawing() {
  Drawing drawing;
  drawing.min_m = {-0.04, -0.04};
  drawing.max_m = {0.04, 0.04};
  for (int row = -2; row < 2; ++row) {
    for (int column = -2; column < 2; ++column) {
      if ((row + column) % 2 != 0) continue;
      drawing.AddRectangle(0.01 * column, 0.01 * row, 0.01 * (column + 1), 0.01 * (row + 1), 0);
    }
  }
  drawing.AddRectangle(0.003, -0.007, 0.007, -0.003, 0.2);
  return drawing;
}

TEST(CellPatternTest, MatchesTheDrawing) {
  const CellPattern pattern = CellsOf(TestDrawing(), {-0.008, -0.008}, {0.008, 0.008});
  ASSERT_EQ(pattern.x_m, (std::vector<double>{0, 0.003, 0.007}));
  ASSERT_EQ(pattern.y_m, (std::vector<double>{-0.007, -0.003, 0}));
  EXPECT_EQ(pattern.albedo(0, 0), 0);    // Upper left.
  EXPECT_EQ(pattern.albedo(1, 2), 0.2);  // The small square.
  EXPECT_EQ(pattern.albedo(2, 2), 1);    // Below the small square.
  EXPECT_EQ(pattern.albedo(3, 1), 0);    // Lower right.
  EXPECT_EQ(pattern.albedo(3, 0), 1);    // Lower left.
}

double AlbedoAt(const CellPattern& pattern, const Eigen::Vector2d& point_m) {
  const auto x = std::lower_bound(pattern.x_m.begin(), pattern.x_m.end(), point_m.x()) - pattern.x_m.begin();
  const auto y = std::lower_bound(pattern.y_m.begin(), pattern.y_m.end(), point_m.y()) - pattern.y_m.begin();
  return pattern.albedo(y, x);
}

// Returns the mean albedo around a point, weighted by the Gaussian of the blur, as a sum over a fine grid.
double GaussianMean(const CellPattern& pattern, const Eigen::Vector2d& centre_m,
                    const Eigen::Matrix2d& pattern_by_image, double blur_px) {
  constexpr int kSteps = 300;
  double sum = 0;
  double weights = 0;
  for (int i = -kSteps; i <= kSteps; ++i) {
    for (int j = -kSteps; j <= kSteps; ++j) {
      const Eigen::Vector2d q(6.0 * i / kSteps, 6.0 * j / kSteps);  // Unit: sigmas.
      const double weight = std::exp(-0.5 * q.squaredNorm());
      sum += weight * AlbedoAt(pattern, centre_m + pattern_by_image * (blur_px * q));
      weights += weight;
    }
  }
  return sum / weights;
}

struct PatternPoint {
  const char* name;
  Eigen::Vector2d at_m;
};
void PrintTo(const PatternPoint& point, std::ostream* stream) { *stream << point.name; }

class BlurredTest : public testing::TestWithParam<PatternPoint> {};

// The closed form is compared with sums over a fine grid, for maps with shear and perspective foreshortening.
TEST_P(BlurredTest, IsTheGaussianMeanOfTheCells) {
  const Eigen::Vector2d at_m = GetParam().at_m;
  const CellPattern pattern = CellsOf(TestDrawing(), {-0.02, -0.02}, {0.02, 0.02});
  Eigen::Matrix2d image_by_pattern;
  image_by_pattern << 900, 500, -200, 400;
  constexpr double kBlurPx = 1.3;
  const BlurredAlbedo blurred = Blurred(pattern, at_m, image_by_pattern, kBlurPx);
  constexpr double kGridError = 2e-3;  // Error of the sums, because cells end between grid points.
  EXPECT_NEAR(blurred.value, GaussianMean(pattern, at_m, image_by_pattern.inverse(), kBlurPx), kGridError);
  constexpr double kStepM = 2e-7;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d step_m = kStepM * Eigen::Vector2d::Unit(axis);
    const double numeric = (Blurred(pattern, at_m + step_m, image_by_pattern, kBlurPx).value -
                            Blurred(pattern, at_m - step_m, image_by_pattern, kBlurPx).value) /
                           (2 * kStepM);
    EXPECT_NEAR(blurred.by_at[axis], numeric, 1e-3 * (1 + std::abs(numeric)) + 0.1);
  }
  constexpr double kStepPx = 1e-4;
  const double by_blur = (Blurred(pattern, at_m, image_by_pattern, kBlurPx + kStepPx).value -
                          Blurred(pattern, at_m, image_by_pattern, kBlurPx - kStepPx).value) /
                         (2 * kStepPx);
  EXPECT_NEAR(blurred.by_blur, by_blur, 1e-3);
}

INSTANTIATE_TEST_SUITE_P(, BlurredTest,
                         testing::Values(PatternPoint{"corner_of_squares", {0.0005, -0.0007}},
                                         PatternPoint{"left_corner_of_small_square", {0.0031, -0.0036}},
                                         PatternPoint{"edge_of_squares", {-0.0004, 0.006}},
                                         PatternPoint{"right_corner_of_small_square", {0.0068, -0.0031}}),
                         [](const auto& test) { return test.param.name; });

struct FitTotals {
  Eigen::Vector2d sum_px = Eigen::Vector2d::Zero();
  double squares_px2 = 0;
  double chi2 = 0;
  int count = 0;
};

// Fits rendered views of the corner at the origin, which are tilted and rotated, from initial guesses with errors of
// up to half a pixel. Each image moves by motion_px (odd) along its rows during the exposure.
FitTotals FitViews(const RenderOptions& options_in, int num_views, double squares_sigma_px = 0, int motion_px = 1,
                   MapFreedom freedom = MapFreedom::kQuadratic) {
  const Drawing drawing = TestDrawing();
  const Camera camera{"pinhole", 120, 100, {900, 900, 59.5, 49.5}};
  Rng rng(3);
  FitTotals totals;
  for (int i = 0; i < num_views; ++i) {
    const double towards = rng.Uniform(-M_PI, M_PI);
    const Rigid3d pose{ExpRotation(rng.Uniform(0, 0.7) * Eigen::Vector3d(std::cos(towards), std::sin(towards), 0)) *
                           ExpRotation(rng.Uniform(-M_PI, M_PI) * Eigen::Vector3d::UnitZ()),
                       {rng.Uniform(-0.001, 0.001), rng.Uniform(-0.001, 0.001), 0.6}};
    RenderOptions options = options_in;
    options.seed = static_cast<uint64_t>(i) + 1;
    cv::Mat image = RenderView(drawing, camera, pose, options);
    cv::blur(image, image, {motion_px, 1});
    Eigen::Matrix3d intrinsics;
    intrinsics << 900, 0, 59.5, 0, 900, 49.5, 0, 0, 1;
    Eigen::Matrix3d plane;
    plane << pose.RotationMatrix().leftCols<2>(), pose.translation;
    Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
    shift(0, 2) = rng.Uniform(-0.5, 0.5);
    shift(1, 2) = rng.Uniform(-0.5, 0.5);
    const Eigen::Matrix3d truth = intrinsics * plane;
    PatternFitOptions fit_options;
    fit_options.min_m = {-0.008, -0.008};
    fit_options.max_m = {0.008, 0.008};
    fit_options.squares_sigma_px = squares_sigma_px;
    fit_options.freedom = freedom;
    const std::optional<PatternFit> fit = FitPattern(image, CellsOf(drawing, {-0.016, -0.016}, {0.016, 0.016}),
                                                     shift * truth, {Eigen::Vector2d::Zero()}, fit_options);
    if (!fit) continue;
    const Eigen::Vector2d error_px = fit->pixels[0] - ApplyHomography(truth, Eigen::Vector2d::Zero());
    totals.sum_px += error_px;
    totals.squares_px2 += error_px.squaredNorm();
    totals.chi2 += MahalanobisSquare(error_px, fit->covariance_px2);
    ++totals.count;
  }
  return totals;
}

using PatternKernelTest = EverySimdTest;

TEST_P(PatternKernelTest, AgreesWithTheBaseline) {
  RenderOptions options;
  options.noise_sigma_grey = 2;
  const FitTotals here = FitViews(options, 10);
  LimitSimd(Simd::kBaseline);
  const FitTotals baseline = FitViews(options, 10);
  EXPECT_EQ(here.count, 10);
  EXPECT_EQ(here.count, baseline.count);
  EXPECT_LT((here.sum_px - baseline.sum_px).norm(), 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Sets, PatternKernelTest, EverySimd(), SimdName);

TEST(FitPatternTest, FindsACornerWithinItsCovariance) {
  RenderOptions options;
  options.noise_sigma_grey = 2;
  options.light_gradient = 0.3;
  constexpr int kViews = 200;
  const FitTotals totals = FitViews(options, kViews);
  EXPECT_EQ(totals.count, kViews);
  RecordProperty("rms_px", std::to_string(std::sqrt(totals.squares_px2 / (2 * kViews))));
  RecordProperty("chi2_per_dof", std::to_string(totals.chi2 / (2 * kViews)));
  EXPECT_LT(std::sqrt(totals.squares_px2 / (2 * kViews)), 0.015);
  EXPECT_LT((totals.sum_px / kViews).norm(), 0.003);
  // The mean is over 400 numbers: three sigma are 0.21, and the rest allows for errors of the model.
  EXPECT_NEAR(totals.chi2 / (2 * kViews), 1, 0.25);
}

TEST(FitPatternTest, IsAccurateToThousandthsWithoutNoise) {
  const FitTotals totals = FitViews({}, 40);
  EXPECT_EQ(totals.count, 40);
  EXPECT_LT(std::sqrt(totals.squares_px2 / 80), 0.003);
}

// An isotropic blur would move the corner by 0.13 px.
TEST(FitPatternTest, IsAccurateInImagesThatMoved) {
  const FitTotals totals = FitViews({}, 40, 0, 7, MapFreedom::kStrongLens);
  EXPECT_EQ(totals.count, 40);
  EXPECT_LT(std::sqrt(totals.squares_px2 / 80), 0.04);
}

// Apart from the noise the pixels are black or white; the steps along the edges are the larger error.
TEST(FitPatternTest, StatesTheErrorOfImagesWithoutAntiAliasing) {
  RenderOptions options;
  options.is_point_sampled = true;
  options.noise_sigma_grey = 2;
  constexpr int kViews = 200;
  const FitTotals totals = FitViews(options, kViews);
  EXPECT_EQ(totals.count, kViews);
  EXPECT_LT(std::sqrt(totals.squares_px2 / (2 * kViews)), 0.12);
  // The steps alternate along an edge, so their errors are not independent: the stated sigma may be too large by a
  // factor of 2 or too small by a factor of 1.4.
  EXPECT_GT(totals.chi2 / (2 * kViews), 0.25);
  EXPECT_LT(totals.chi2 / (2 * kViews), 2);
}

// If an edge is known to be straight, all of its pixels determine its position: 9/4 of the information on the
// position of a line.
TEST(FitPatternTest, IsMoreAccurateIfEdgesAreStraight) {
  RenderOptions options;
  options.noise_sigma_grey = 2;
  constexpr int kViews = 200;
  const FitTotals unknown = FitViews(options, kViews);
  const FitTotals known = FitViews(options, kViews, /*squares_sigma_px=*/1e-3);
  EXPECT_EQ(known.count, kViews);
  EXPECT_LT(std::sqrt(known.squares_px2 / unknown.squares_px2), 0.85);
  EXPECT_NEAR(known.chi2 / (2 * kViews), 1, 0.25);
}

TEST(FitPatternTest, RefusesImagesWithoutThePattern) {
  const Drawing drawing = TestDrawing();
  PatternFitOptions options;
  options.min_m = {-0.008, -0.008};
  options.max_m = {0.008, 0.008};
  Eigen::Matrix3d start;
  start << 1500, 0, 60, 0, 1500, 50, 0, 0, 1;
  const CellPattern pattern = CellsOf(drawing, {-0.016, -0.016}, {0.016, 0.016});
  cv::Mat blank(100, 120, CV_8UC1, cv::Scalar(128));
  EXPECT_FALSE(FitPattern(blank, pattern, start, {Eigen::Vector2d::Zero()}, options).has_value());
  cv::Mat noise(100, 120, CV_8UC1);
  cv::theRNG() = cv::RNG(5);
  cv::randu(noise, 0, 256);
  EXPECT_FALSE(FitPattern(noise, pattern, start, {Eigen::Vector2d::Zero()}, options).has_value());
  // Half of the corner lies outside the image.
  start(0, 2) = 0;
  EXPECT_FALSE(FitPattern(blank, pattern, start, {Eigen::Vector2d::Zero()}, options).has_value());
}

}  // namespace
}  // namespace heba
