// The Gram matrix J^T J of rows that arrive a few at a time. The rows are buffered until there are enough of them for
// vectorised sums.
#pragma once

#include <Eigen/Core>

#include "heba/kernels/gram_matrix.h"

namespace heba {

class StackedRows {
 public:
  static constexpr int kMaxRows = 128;  // Capacity of the buffer.
  // Up to this number of columns, the products are vectorised for few columns.
  static constexpr int kFewColumns = GramMatrix::kMaxColumns;

  explicit StackedRows(int num_columns);

  // Returns the memory for the next `num_rows` rows, at most kMaxRows. The caller must write all of them before calling
  // another function.
  template <int kRows>
  auto Next(Eigen::Index num_rows = kRows) {
    return Eigen::Map<Eigen::Matrix<double, kRows, Eigen::Dynamic>, 0, Eigen::OuterStride<kMaxRows>>(
        NextColumns(num_rows), num_rows, num_columns_);
  }
  // Returns the memory of the first column of the next rows; each further column begins kMaxRows doubles later.
  double* NextColumns(Eigen::Index num_rows);

  // Adds the inner products of all pairs of columns to `matrix`, to its lower triangle only.
  void AddTo(Eigen::MatrixXd* matrix);
  // Returns the inner products as a symmetric matrix.
  Eigen::MatrixXd Products();

 private:
  void Multiply();
  bool IsWide() const { return num_columns_ > kFewColumns; }
  double* Columns() { return IsWide() ? wide_columns_.data() : columns_[0]; }

  int num_columns_;
  Eigen::Index size_ = 0;  // Number of rows in `columns_`.
  GramMatrix products_;
  // The extra column pads an odd number of columns (GramMatrix::Add).
  alignas(64) double columns_[kFewColumns + 1][kMaxRows];
  // With many columns, these are used instead.
  Eigen::MatrixXd wide_columns_;
  Eigen::MatrixXd wide_products_;
};

}  // namespace heba
