#include "heba/kernels/stacked_rows.h"

#include <gtest/gtest.h>

#include "heba/kernels/small_matrix.h"
#include "tests/support/simd_sets.h"

namespace heba {
namespace {

using StackedRowsTest = EverySimdTest;

TEST_P(StackedRowsTest, SumTheProductsOfAllRows) {
  for (int num_columns = 1; num_columns <= StackedRows::kFewColumns + 9; ++num_columns) {
    StackedRows stacked(num_columns);
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(num_columns, num_columns);
    // Blocks of several sizes do not fill the buffer exactly.
    for (int i = 0; i < 60; ++i) {
      const Eigen::MatrixXd rows = Eigen::MatrixXd::Random(i % 7, num_columns);
      stacked.Next<Eigen::Dynamic>(rows.rows()) = rows;
      const Eigen::MatrixXd six = Eigen::MatrixXd::Random(6, num_columns);
      stacked.Next<6>() = six;
      expected += rows.transpose() * rows + six.transpose() * six;
    }
    EXPECT_LT((stacked.Products() - expected).cwiseAbs().maxCoeff(), 1e-11) << num_columns;
  }
}

// A sum without rows is zero, however many columns it has.
TEST_P(StackedRowsTest, SumOfNoRowsIsZero) {
  for (const int num_columns : {3, StackedRows::kFewColumns + 1, 200}) {
    EXPECT_TRUE(StackedRows(num_columns).Products().isZero(0)) << num_columns;
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, StackedRowsTest, EverySimd(), SimdName);

TEST(SmallMatrixTest, SolvesAndInvertsLowerTriangles) {
  for (const int size : {1, 6, 21}) {
    const Eigen::MatrixXd full = Eigen::MatrixXd::Random(size, size) + 4 * Eigen::MatrixXd::Identity(size, size);
    const Eigen::MatrixXd lower = full.triangularView<Eigen::Lower>();
    const RowMajorMatrix right = RowMajorMatrix::Random(size, 5);
    RowMajorMatrix solved = right;
    SolveLowerInPlace(full, &solved);  // Only the lower triangle is read.
    EXPECT_LT((lower * solved - right).cwiseAbs().maxCoeff(), 1e-12) << size;
  }
  const Matrix6 full = Matrix6::Random() + 4 * Matrix6::Identity();
  const Matrix6 lower = full.triangularView<Eigen::Lower>();
  EXPECT_LT((lower * InverseOfLower(full) - Matrix6::Identity()).cwiseAbs().maxCoeff(), 1e-14);
}

}  // namespace
}  // namespace heba
