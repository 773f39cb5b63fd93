#include "solvers/residuals/view_reduction.h"

#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "solvers/residuals/inliers.h"
#include "tests/support/scenes.h"

namespace heba {
namespace {

// Returns the residuals of a view without any reduction; they are differentiated numerically.
Eigen::VectorXd Residual(const TestScene& scene, const View& view, const Rigid3d& camera_from_target,
                         const std::vector<double>& params) {
  Camera camera = scene.camera;
  camera.params = params;
  const Points2 residuals = *Residuals(camera, camera_from_target, view.observations);
  return Eigen::Map<const Eigen::VectorXd>(residuals.data(), residuals.size());
}

FreeParameters AllFree(const TestScene& scene) { return FreeParameters(scene.camera.params.size(), true); }

// Returns the derivatives of the residuals by the pose (translation, rotation) and by the camera's parameters, from
// central differences.
Eigen::MatrixXd NumericJacobian(const TestScene& scene, const View& view, const Rigid3d& camera_from_target) {
  const int n = 6 + NumParams(scene.camera.Model());
  Eigen::MatrixXd jacobian(2 * view.observations.size(), n);
  for (int k = 0; k < n; ++k) {
    const double step = k < 6 ? 1e-6 : 1e-6 * std::max(1.0, std::abs(scene.camera.params[static_cast<size_t>(k - 6)]));
    Eigen::VectorXd ends[2];
    for (const int side : {0, 1}) {
      const double h = side == 0 ? -step : step;
      std::vector<double> params = scene.camera.params;
      Rigid3d moved = camera_from_target;
      if (k < 3) moved = Rigid3d(Eigen::Quaterniond::Identity(), h * Eigen::Vector3d::Unit(k)) * moved;
      if (k >= 3 && k < 6) moved = Rigid3d(ExpRotation(h * Eigen::Vector3d::Unit(k - 3)), {0, 0, 0}) * moved;
      if (k >= 6) params[static_cast<size_t>(k - 6)] += h;
      ends[side] = Residual(scene, view, moved, params);
    }
    jacobian.col(k) = (ends[1] - ends[0]) / (2 * step);
  }
  return jacobian;
}

// The parameter is the number of columns of the target, which has two rows.
class ReducedViewTest : public testing::TestWithParam<int> {};

TEST_P(ReducedViewTest, KeepsCostGradientAndGaussNewtonMatrix) {
  TestSceneOptions options;
  options.points = GridPoints(GetParam(), 2, 0.04);
  options.noise_px = 0.5;
  const TestScene scene = MakeTestScene(2, options);
  const View& view = scene.views[0];
  const Rigid3d pose = scene.pairs[0].camera_from_target;
  const CameraModel& model = scene.camera.Model();
  SquareRootInformation reduction;
  constexpr double kSigmaPx = 0.5;
  const ViewReducer reducer(model, AllFree(scene), kSigmaPx, LossOf(LossKind::kNone));
  ASSERT_TRUE(reducer.Reduce(scene.camera.params.data(), pose, view.observations, nullptr, &reduction));
  const Eigen::VectorXd r = Residual(scene, view, pose, scene.camera.params) / kSigmaPx;
  const Eigen::MatrixXd j = NumericJacobian(scene, view, pose) / kSigmaPx;
  const Eigen::Index n = j.cols();
  const Eigen::MatrixXd f = reduction.factor.leftCols(n);
  const Eigen::VectorXd e = reduction.factor.rightCols<1>();
  constexpr double kDifferences = 1e-6;  // Relative error of central differences of smooth functions.
  EXPECT_NEAR(e.squaredNorm(), r.squaredNorm(), 1e-10 * r.squaredNorm());
  EXPECT_LT((f.transpose() * f - j.transpose() * j).norm(), kDifferences * (j.transpose() * j).norm());
  EXPECT_LT((f.transpose() * e - j.transpose() * r).norm(), kDifferences * (j.transpose() * r).norm());
  EXPECT_LE(reduction.factor.rows(), n + 1);
  EXPECT_EQ(reduction.loss_remainder, 0);
}

INSTANTIATE_TEST_SUITE_P(, ReducedViewTest, testing::Values(2, 8), [](const auto& test) {
  return test.param == 2 ? "fewer_residuals_than_unknowns" : "more_residuals_than_unknowns";
});

TEST(ViewReductionTest, CostWithALossIsTheSumOfRho) {
  TestSceneOptions options;
  options.noise_px = 3;
  const TestScene scene = MakeTestScene(4, options);
  const Loss& loss = LossOf(LossKind::kHuber);
  double direct = 0;
  const Points2 residuals = *Residuals(scene.camera, scene.pairs[0].camera_from_target, scene.views[0].observations);
  for (Eigen::Index i = 0; i < residuals.cols(); ++i) direct += loss.rho(residuals.col(i).squaredNorm());
  SquareRootInformation reduction;
  const ViewReducer reducer(scene.camera.Model(), AllFree(scene), 1.0, loss);
  ASSERT_TRUE(reducer.Reduce(scene.camera.params.data(), scene.pairs[0].camera_from_target, scene.views[0].observations,
                             nullptr, &reduction));
  EXPECT_NEAR(reduction.factor.rightCols<1>().squaredNorm() + reduction.loss_remainder, direct, 1e-9 * direct);
}

// The kinds of observations and unknowns for which a view has different code: how many points, whether with
// correlated points or discs, whether the shape is unknown, and the loss.
using ViewCase = std::tuple<int, std::string, bool, std::string>;
class ViewKindsTest : public testing::TestWithParam<ViewCase> {};

TEST_P(ViewKindsTest, WrittenRowsHaveTheSameNormalEquations) {
  const auto& [num_points, kind, has_shape, loss] = GetParam();
  TestSceneOptions options;
  options.noise_px = 3;
  options.points = GridPoints(13, 5, 0.02);
  const TestScene scene = MakeTestScene(5, options);
  const Observations& all = scene.views[0].observations;
  std::vector<bool> keep(static_cast<size_t>(all.size()), false);
  std::fill_n(keep.begin(), num_points, true);
  Observations observations = KeepPoints(all, keep);
  for (int i = 0; kind == "correlated" && i < observations.size(); ++i) {
    observations.whitening.emplace_back((Eigen::Matrix2d() << 1.1, 0, 0.1 * i, 0.9).finished());
  }
  if (kind == "discs") observations.radii_m = Eigen::VectorXd::Constant(observations.size(), 0.008);
  const TargetShape designed = DesignedShape(all.points_in_target);
  const TargetShape* const shape = has_shape ? &designed : nullptr;

  FreeParameters free(scene.camera.params.size() + (shape == nullptr ? 0 : TargetShape::kNumParams), true);
  free[2] = false;
  const ViewReducer reducer(scene.camera.Model(), free, 0.5, LossOf(*FindLossKind(loss)));
  const Rigid3d& pose = scene.pairs[0].camera_from_target;
  ViewNormalEquations products;
  ViewRows rows;
  ASSERT_TRUE(reducer.Multiply(scene.camera.params.data(), pose, observations, shape, &products));
  ASSERT_TRUE(reducer.Write(scene.camera.params.data(), pose, observations, shape, &rows));
  ASSERT_EQ(products.matrix.cols(), reducer.num_columns());
  const auto columns = rows.columns.leftCols(reducer.num_columns());
  const Eigen::MatrixXd from_rows = columns.transpose() * columns;
  const Eigen::VectorXd scale = products.matrix.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  EXPECT_LT((scale.asDiagonal() * (from_rows - products.matrix) * scale.asDiagonal()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_NEAR(rows.loss_remainder, products.loss_remainder, 1e-12 * (1 + products.loss_remainder));
}

INSTANTIATE_TEST_SUITE_P(, ViewKindsTest,
                         testing::Combine(testing::Values(1, 4, 63, 64, 65),
                                          testing::Values("plain", "correlated", "discs"), testing::Bool(),
                                          testing::Values("none", "huber")),
                         [](const auto& test) {
                           return std::to_string(std::get<0>(test.param)) + "_" + std::get<1>(test.param) +
                                  (std::get<2>(test.param) ? "_shape_" : "_") + std::get<3>(test.param);
                         });

struct FreePattern {
  const char* name;
  bool (*is_free)(size_t parameter);
};
void PrintTo(const FreePattern& pattern, std::ostream* stream) { *stream << pattern.name; }

// The parameters say if the points are correlated, if the shape is unknown, and which parameters are free.
class FreeParametersTest : public testing::TestWithParam<std::tuple<bool, bool, FreePattern>> {};

TEST_P(FreeParametersTest, AloneHaveColumns) {
  const auto& [is_correlated, has_shape, pattern] = GetParam();
  TestSceneOptions options;
  options.noise_px = 0.5;
  const TestScene scene = MakeTestScene(7, options);
  Observations observations = scene.views[0].observations;
  for (int i = 0; is_correlated && i < observations.size(); ++i) {
    observations.whitening.emplace_back((Eigen::Matrix2d() << 1.1, 0, 0.1 * i, 0.9).finished());
  }
  const TargetShape designed = DesignedShape(observations.points_in_target);
  const TargetShape* const shape = has_shape ? &designed : nullptr;
  const auto multiply = [&](const FreeParameters& free) {
    ViewNormalEquations products;
    const ViewReducer reducer(scene.camera.Model(), free, 0.5, LossOf(LossKind::kHuber));
    EXPECT_TRUE(reducer.Multiply(scene.camera.params.data(), scene.pairs[0].camera_from_target, observations, shape,
                                 &products));
    return products.matrix;
  };
  const int num_camera = NumParams(scene.camera.Model());
  const FreeParameters all(static_cast<size_t>(num_camera + (has_shape ? TargetShape::kNumParams : 0)), true);
  const Eigen::MatrixXd whole = multiply(all);
  ASSERT_EQ(whole.cols(), 6 + static_cast<Eigen::Index>(all.size()) + 1);
  FreeParameters free;
  std::vector<Eigen::Index> kept = {0, 1, 2, 3, 4, 5};
  for (size_t i = 0; i < all.size(); ++i) {
    free.push_back(pattern.is_free(i));
    if (pattern.is_free(i)) kept.push_back(6 + static_cast<Eigen::Index>(i));
  }
  kept.push_back(whole.cols() - 1);
  const Eigen::MatrixXd expected = whole(kept, kept);
  EXPECT_LT((multiply(free) - expected).norm(), 1e-12 * expected.norm());
}

INSTANTIATE_TEST_SUITE_P(
    , FreeParametersTest,
    testing::Combine(testing::Bool(), testing::Bool(),
                     testing::Values(FreePattern{"every_second", [](size_t i) { return i % 2 == 0; }},
                                     FreePattern{"every_third", [](size_t i) { return i % 3 == 1; }},
                                     FreePattern{"none", [](size_t) { return false; }},
                                     FreePattern{"fy", [](size_t i) { return i == 1; }},
                                     FreePattern{"cy_and_p1", [](size_t i) { return i == 3 || i == 6; }})),
    [](const auto& test) {
      return std::string(std::get<0>(test.param) ? "correlated" : "plain") +
             (std::get<1>(test.param) ? "_shape_" : "_") + std::get<2>(test.param).name;
    });

TEST(ViewReductionTest, PivotedCholeskyReproducesTheProducts) {
  // The matrix has more columns than its rank, and columns of very different units.
  Eigen::MatrixXd rows = Eigen::MatrixXd::Random(5, 9);
  rows.col(3) *= 1e8;
  rows.col(6).setZero();
  const Eigen::MatrixXd products = rows.transpose() * rows;
  const Eigen::MatrixXd root = PivotedCholesky(products);
  const Eigen::VectorXd lengths = products.diagonal().cwiseSqrt().cwiseMax(1e-300);
  const Eigen::MatrixXd difference =
      lengths.cwiseInverse().asDiagonal() * (root.transpose() * root - products) * lengths.cwiseInverse().asDiagonal();
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_TRUE(root.bottomRows<1>().leftCols(8).isZero());
}

// The points form an ordinary target or lie nearly on a line, which leaves one rotation of the pose almost
// undetermined; the test covers both with and without the columns of the camera.
TEST(ViewReductionTest, PoseColumnsAreZeroBelowTheSixthRow) {
  for (const double height : {1.0, 1e-3, 1e-6, 0.0}) {
    for (const bool has_camera : {true, false}) {
      TestSceneOptions options;
      options.points = GridPoints(12, 3, 0.02);
      options.points.row(1) *= height;
      options.noise_px = 0.5;
      const TestScene scene = MakeTestScene(2, options);
      const View& view = scene.views[0];
      const Rigid3d pose = scene.pairs[0].camera_from_target;
      const FreeParameters free(scene.camera.params.size(), has_camera);
      const ViewReducer reducer(scene.camera.Model(), free, 0.5, LossOf(LossKind::kNone));
      ViewNormalEquations products;
      SquareRootInformation reduction;
      ASSERT_TRUE(reducer.Multiply(scene.camera.params.data(), pose, view.observations, nullptr, &products));
      ASSERT_TRUE(reducer.Reduce(scene.camera.params.data(), pose, view.observations, nullptr, &reduction));
      const Eigen::MatrixXd& factor = reduction.factor;
      ASSERT_EQ(factor.rows(), reducer.num_columns());
      EXPECT_TRUE(factor.bottomLeftCorner(factor.rows() - 6, 6).isZero(0));
      EXPECT_TRUE(factor.bottomRows<1>().leftCols(factor.cols() - 1).isZero(0));
      const Eigen::VectorXd inverse_lengths = products.matrix.diagonal().cwiseSqrt().cwiseInverse();
      const Eigen::MatrixXd difference =
          inverse_lengths.asDiagonal() * (factor.transpose() * factor - products.matrix) * inverse_lengths.asDiagonal();
      EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-7) << height << " " << has_camera;
    }
  }
}

}  // namespace
}  // namespace heba
