#include "heba/base/factorisation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "heba/base/rng.h"

namespace heba {
namespace {

Eigen::MatrixXd RandomMatrix(Eigen::Index rows, Eigen::Index columns, Rng& rng) {
  Eigen::MatrixXd matrix(rows, columns);
  for (double& value : matrix.reshaped()) value = rng.Normal();
  return matrix;
}

Eigen::MatrixXd RandomPositive(Eigen::Index size, Rng& rng) {
  const Eigen::MatrixXd root = RandomMatrix(size, size + 2, rng);
  return root * root.transpose();
}

// Sizes with code of their own, of moderate size, and large.
class FactorisationTest : public testing::TestWithParam<int> {};

TEST_P(FactorisationTest, IdentityPlusSquareIsFactorisedHoweverLargeTheSquareIs) {
  Rng rng(6);
  const Eigen::Index size = GetParam();
  constexpr double kLarge = 1e10;  // Its square leaves no digit of the identity.
  for (const double scale : {0.0, 1.0, kLarge}) {
    const Eigen::MatrixXd b = scale * RandomMatrix(size, std::max<Eigen::Index>(1, size / 2), rng);
    const auto root = CholeskyFactor<Eigen::Dynamic>::OfIdentityPlusSquare(b);
    const Eigen::MatrixXd lower = root.lower().triangularView<Eigen::Lower>();
    const Eigen::MatrixXd square = Eigen::MatrixXd::Identity(size, size) + b * b.transpose();
    EXPECT_LT((lower * lower.transpose() - square).norm(), 1e-12 * square.norm());
    EXPECT_GT(lower.diagonal().minCoeff(), 0.99);
    // The identity is what is left of the space that B does not reach.
    const Eigen::VectorXd other = RandomMatrix(size, 1, rng);
    const Eigen::VectorXd beside =
        other - b * (scale > 0 ? Eigen::VectorXd(SolveSymmetric(b.transpose() * b, b.transpose() * other))
                               : Eigen::VectorXd::Zero(b.cols()));
    EXPECT_LT((root.Solve(beside) - beside).norm(), 1e-4 * other.norm());
  }
}

TEST_P(FactorisationTest, SolutionsSolveTheirEquations) {
  Rng rng(1);
  const Eigen::Index size = GetParam();
  const Eigen::MatrixXd a = RandomPositive(size, rng);
  for (const Eigen::Index columns : {1, 3}) {
    const Eigen::MatrixXd b = RandomMatrix(size, columns, rng);
    EXPECT_LT((a * SolveSymmetric(a, b) - b).norm(), 1e-9);
    const auto root = Cholesky(a);
    ASSERT_TRUE(root.has_value());
    EXPECT_LT((a * root->Solve(b) - b).norm(), 1e-9);
    const Eigen::MatrixXd lower = root->lower().triangularView<Eigen::Lower>();
    EXPECT_LT((lower * lower.transpose() - a).norm(), 1e-12 * a.norm());
    EXPECT_LT((lower * root->SolveLower(b) - b).norm(), 1e-10);
    EXPECT_LT((lower.transpose() * root->SolveLowerTransposed(b) - b).norm(), 1e-10);
    EXPECT_NEAR(root->LogDeterminant(), 2 * lower.diagonal().array().log().sum(), 1e-12);
  }
  const Eigen::VectorXd d = RandomMatrix(size, 1, rng);
  EXPECT_NEAR(MahalanobisSquare(d, a), d.dot(InverseOfSymmetric(a) * d), 1e-9);
}

TEST_P(FactorisationTest, EigenvectorsDiagonalise) {
  Rng rng(2);
  const Eigen::MatrixXd a = RandomPositive(GetParam(), rng);
  const SymmetricEigen<Eigen::Dynamic> eigen = EigenOfSymmetric(a);
  const Eigen::MatrixXd again = eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose();
  EXPECT_LT((again - a).norm(), 1e-12 * a.norm());
  EXPECT_TRUE(std::is_sorted(eigen.values.begin(), eigen.values.end()));
  EXPECT_LT((eigen.Root() * eigen.Root() - a).norm(), 1e-12 * a.norm());
  EXPECT_LT((eigen.InverseRoot() * a * eigen.InverseRoot() - Eigen::MatrixXd::Identity(a.rows(), a.rows())).norm(),
            1e-9);
}

INSTANTIATE_TEST_SUITE_P(Sizes, FactorisationTest, testing::Values(1, 2, 3, 5, 6, 16, 17, 40));

// Only the lower triangle of a symmetric matrix is read, of any kind of expression.
TEST(FactorisationOfExpressionsTest, TheUpperTriangleIsNotRead) {
  Eigen::Matrix2d a;
  a << 2, NAN, 1, 3;
  const Eigen::Vector2d x = SolveSymmetric(a * 1.0, Eigen::Vector2d(3, 4));
  EXPECT_LT((x - Eigen::Vector2d(1, 1)).norm(), 1e-15);
  EXPECT_TRUE(Cholesky(a).has_value());
  EXPECT_NEAR(EigenOfSymmetric(a).values.sum(), 5, 1e-12);
}

TEST(FactorisationOfExpressionsTest, SingularMatrices) {
  // The solution has no part in a direction in which the matrix is zero.
  const Eigen::Matrix3d a = Eigen::Vector3d(2, 0, 4).asDiagonal();
  EXPECT_EQ(Eigen::Vector3d(SolveSymmetric(a, Eigen::Vector3d(2, 3, 4))), Eigen::Vector3d(1, 0, 1));
  EXPECT_FALSE(Cholesky(Eigen::Matrix3d(-a)).has_value());
  EXPECT_FALSE(Cholesky(Eigen::MatrixXd(-Eigen::MatrixXd::Identity(7, 7))).has_value());
}

TEST(HouseholderFactorTest, QIsOrthogonalAndRIsUpper) {
  Rng rng(3);
  for (const auto& [rows, columns] : {std::pair(9, 4), std::pair(4, 4), std::pair(3, 6)}) {
    const Eigen::MatrixXd a = RandomMatrix(rows, columns, rng);
    const HouseholderFactor factor(a);
    const Eigen::MatrixXd r = factor.R();
    const Eigen::MatrixXd basis = factor.Basis();
    EXPECT_LT((basis * r - a).norm(), 1e-13);
    EXPECT_LT((basis.transpose() * basis - Eigen::MatrixXd::Identity(r.rows(), r.rows())).norm(), 1e-13);
    EXPECT_LT((factor.Rotated(a).topRows(r.rows()) - r).norm(), 1e-13);
    EXPECT_TRUE(r.isUpperTriangular(0));
  }
}

}  // namespace
}  // namespace heba
