#include "heba/kernels/inverse_root.h"

#include <random>

#include <gtest/gtest.h>

namespace heba {
namespace {

Eigen::MatrixXd DrawPositive(Eigen::Index size, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd rows = Eigen::MatrixXd::NullaryExpr(size + 5, size, [&] { return normal(random); });
  return rows.transpose() * rows;
}

// X is lower triangular, and X A X^T is the identity, for sizes that are and are not split, and that are no multiple of
// any number of lanes. What is above the diagonal of A does not matter.
TEST(InverseRootTest, IsTheInverseOfTheCholeskyFactor) {
  for (const Eigen::Index size : {1, 7, 24, 25, 49, 111, 165}) {
    SCOPED_TRACE(size);
    const Eigen::MatrixXd matrix = DrawPositive(size, static_cast<unsigned>(size));
    Eigen::MatrixXd lower = matrix.triangularView<Eigen::Lower>();
    lower.triangularView<Eigen::StrictlyUpper>().setConstant(17);
    const std::optional<Eigen::MatrixXd> root = InverseRootOf(lower);
    ASSERT_TRUE(root.has_value());
    EXPECT_EQ(root->triangularView<Eigen::StrictlyUpper>().toDenseMatrix().norm(), 0);
    EXPECT_GT(root->diagonal().minCoeff(), 0);
    const Eigen::MatrixXd product = *root * matrix * root->transpose();
    EXPECT_LT((product - Eigen::MatrixXd::Identity(size, size)).norm(), 1e-9);
  }
}

// A matrix with a direction that is negative or zero has no root, wherever it is.
TEST(InverseRootTest, RefusesWhatIsNotPositive) {
  for (const Eigen::Index size : {5, 60}) {
    for (const Eigen::Index place : {Eigen::Index{0}, size / 2, size - 1}) {
      Eigen::MatrixXd matrix = DrawPositive(size, 3);
      matrix(place, place) = -1;
      EXPECT_FALSE(InverseRootOf(matrix).has_value()) << size << " " << place;
      matrix = Eigen::MatrixXd::Identity(size, size);
      matrix(place, place) = 0;
      EXPECT_FALSE(InverseRootOf(matrix).has_value()) << size << " " << place;
    }
  }
}

}  // namespace
}  // namespace heba
