#include "heba/kernels/gram_matrix.h"

#include <gtest/gtest.h>

#include "tests/support/simd_sets.h"

namespace heba {
namespace {

using ColumnProductsTest = EverySimdTest;

TEST_P(ColumnProductsTest, MatchTheProductsOfAllColumnPairs) {
  for (int num_columns = 1; num_columns <= GramMatrix::kMaxColumns; ++num_columns) {
    for (const Eigen::Index num_rows : {8, 40}) {
      const Eigen::Index stride = num_rows + 8;
      Eigen::MatrixXd columns = Eigen::MatrixXd::Random(stride, num_columns + num_columns % 2);
      GramMatrix products(num_columns, stride);
      products.Add(columns.data(), num_rows);
      products.Add(columns.data() + 8, num_rows);
      const auto part = [&](Eigen::Index first) { return columns.block(first, 0, num_rows, num_columns); };
      const Eigen::MatrixXd expected = part(0).transpose() * part(0) + part(8).transpose() * part(8);
      ASSERT_EQ(products.Matrix().rows(), num_columns);
      EXPECT_LT((products.Matrix() - expected).cwiseAbs().maxCoeff(), 1e-13 * static_cast<double>(num_rows))
          << num_columns << " columns, " << num_rows << " rows";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, ColumnProductsTest, EverySimd(), SimdName);

TEST(InnerProductsTest, AreThoseOfTheColumns) {
  for (const Eigen::Index num_rows : {1, 7, 8, 33, 175}) {
    for (const Eigen::Index num_columns : {1, 2, 5, 64, 175}) {
      const Eigen::MatrixXd a = Eigen::MatrixXd::Random(num_rows, num_columns);
      const Eigen::MatrixXd b = Eigen::MatrixXd::Random(num_rows, num_columns + 3);
      EXPECT_LT((InnerProducts(a, b) - a.transpose() * b).norm(), 1e-13 * num_rows * num_columns);
    }
  }
}

}  // namespace
}  // namespace heba
