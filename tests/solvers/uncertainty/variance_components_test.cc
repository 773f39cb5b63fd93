#include "solvers/uncertainty/variance_components.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace heba {
namespace {

// Returns linearised views that follow their model: rows by the unknowns and by a correction, with noise of known
// variances. `pixel` is a variance; `translation_m` and `rotation_rad` are sigmas.
std::vector<LinearisedView> MakeViews(unsigned seed, int num_views, double pixel, double translation_m,
                                      double rotation_rad, int num_rows = 16) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto draw = [&](Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); }));
  };
  constexpr Eigen::Index kUnknowns = 9;
  const Eigen::VectorXd step = draw(kUnknowns, 1);
  std::vector<LinearisedView> views;
  for (int v = 0; v < num_views; ++v) {
    LinearisedView view;
    view.by_unknowns = draw(num_rows, kUnknowns);
    view.by_correction = 1000 * draw(num_rows, 6);
    Tangent6 correction;
    correction << translation_m * draw(3, 1), rotation_rad * draw(3, 1);
    view.offset = view.by_unknowns * step + view.by_correction * correction + std::sqrt(pixel) * draw(num_rows, 1);
    views.push_back(std::move(view));
  }
  return views;
}

void ExpectEstimated(const VarianceComponents& found, double pixel, double translation_m2, double rotation_rad2) {
  constexpr double kSigmas = 4;
  EXPECT_NEAR(found.pixel, pixel, kSigmas * found.stddev[0]);
  EXPECT_NEAR(found.translation_m2, translation_m2, kSigmas * found.stddev[1]);
  EXPECT_NEAR(found.rotation_rad2, rotation_rad2, kSigmas * found.stddev[2]);
}

TEST(VarianceComponentsTest, EstimatesTheDrawnVariances) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const std::vector<LinearisedView> views = MakeViews(seed, 60, 0.7, 2e-3, 5e-3);
    const VarianceComponents found = EstimateVariances(views, {1, 1e-6, 1e-6}, true, true);
    ExpectEstimated(found, 0.7, 4e-6, 25e-6);
    // 60 views with three numbers each determine the variances to about 10 %.
    EXPECT_LT(found.stddev[1], 0.2 * found.translation_m2);
    EXPECT_LT(found.stddev[2], 0.2 * found.rotation_rad2);
  }
}

// A variance of zero is estimated as zero in about half of the runs, and is never large.
TEST(VarianceComponentsTest, EstimatesNoVarianceForAnExactRobot) {
  int num_zeros = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const std::vector<LinearisedView> views = MakeViews(seed, 20, 0.7, 0, 0);
    const VarianceComponents found = EstimateVariances(views, {1, 1e-4, 1e-4}, true, true);
    ExpectEstimated(found, 0.7, 0, 0);
    EXPECT_GE(found.translation_m2, 0);
    EXPECT_GE(found.rotation_rad2, 0);
    num_zeros += found.translation_m2 == 0 ? 1 : 0;
  }
  EXPECT_GT(num_zeros, 3);
  EXPECT_LT(num_zeros, 18);
}

// The result does not depend on the initial guess and is reproduced if it is the initial guess itself.
TEST(VarianceComponentsTest, DoesNotDependOnTheInitialGuess) {
  const std::vector<LinearisedView> views = MakeViews(3, 30, 0.7, 2e-3, 5e-3);
  const VarianceComponents exact = EstimateVariances(views, {1, 1e-6, 1e-6}, true, true);
  const auto expect_near = [&](const VarianceComponents& other, double share_of_stddev) {
    EXPECT_NEAR(other.pixel, exact.pixel, share_of_stddev * exact.stddev[0]);
    EXPECT_NEAR(other.translation_m2, exact.translation_m2, share_of_stddev * exact.stddev[1]);
    EXPECT_NEAR(other.rotation_rad2, exact.rotation_rad2, share_of_stddev * exact.stddev[2]);
  };
  expect_near(EstimateVariances(views, exact, true, true), kExactVariances);
  expect_near(EstimateVariances(views, {100, 0, 0}, true, true), kExactVariances);
  expect_near(EstimateVariances(views, {1e-2, 1, 1}, true, true), kExactVariances);
  expect_near(EstimateVariances(views, {1e-2, 1, 1}, true, true, kRoughVariances), kRoughVariances);
}

TEST(VarianceComponentsTest, KeepsFixedVariances) {
  const std::vector<LinearisedView> views = MakeViews(4, 30, 0.7, 2e-3, 5e-3);
  const VarianceComponents given_pixel = EstimateVariances(views, {0.5, 1e-6, 1e-6}, false, true);
  EXPECT_EQ(given_pixel.pixel, 0.5);
  EXPECT_EQ(given_pixel.stddev[0], 0);
  EXPECT_GT(given_pixel.translation_m2, 1e-6);
  const VarianceComponents given_robot = EstimateVariances(views, {0.5, 1e-6, 3e-6}, true, false);
  EXPECT_EQ(given_robot.translation_m2, 1e-6);
  EXPECT_EQ(given_robot.rotation_rad2, 3e-6);
  EXPECT_NE(given_robot.pixel, 0.5);
}

// The result does not depend on whether the rows that no correction affects are marked as such.
TEST(VarianceComponentsTest, MarkingUnaffectedRowsChangesNothing) {
  std::vector<LinearisedView> views = MakeViews(7, 30, 0.7, 2e-3, 5e-3);
  constexpr Eigen::Index kUnmoved = 10;
  for (LinearisedView& view : views) view.by_correction.bottomRows(kUnmoved).setZero();
  const VarianceComponents untold = EstimateVariances(views, {1, 1e-6, 1e-6}, true, true);
  for (LinearisedView& view : views) view.num_rows_without_correction = kUnmoved;
  const VarianceComponents told = EstimateVariances(views, {1, 1e-6, 1e-6}, true, true);
  EXPECT_NEAR(told.pixel, untold.pixel, 1e-9 * untold.pixel);
  EXPECT_NEAR(told.translation_m2, untold.translation_m2, 1e-9 * untold.translation_m2);
  EXPECT_NEAR(told.rotation_rad2, untold.rotation_rad2, 1e-9 * untold.rotation_rad2);
}

// Views with fewer rows than the correction has parameters are handled, and so are residual sums of squares that are
// given in addition to the rows.
TEST(VarianceComponentsTest, AcceptsFewRowsAndResidualSums) {
  const std::vector<LinearisedView> few = MakeViews(5, 200, 0.7, 2e-3, 5e-3, 4);
  ExpectEstimated(EstimateVariances(few, {1, 1e-6, 1e-6}, true, true), 0.7, 4e-6, 25e-6);
  std::vector<LinearisedView> views = MakeViews(6, 30, 0.7, 2e-3, 5e-3);
  for (LinearisedView& view : views) {
    view.num_residual_dof = 1000;
    view.residual_sum_of_squares = 1000 * 0.7;
  }
  const VarianceComponents found = EstimateVariances(views, {1, 1e-6, 1e-6}, true, true);
  ExpectEstimated(found, 0.7, 4e-6, 25e-6);
  EXPECT_NEAR(found.stddev[0], 0.7 * std::sqrt(2.0 / 30e3), 1e-4);
}

}  // namespace
}  // namespace heba
