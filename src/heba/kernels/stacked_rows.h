// J^T J of rows that come a few at a time: they are gathered until there are enough for vectorised sums.
#pragma once

#include <Eigen/Core>

#include "heba/kernels/gram_matrix.h"

namespace heba {

class StackedRows {
 public:
  static constexpr int kMaxRows = 128;  // That fit in at a time.
  static constexpr int kMaxColumns = GramMatrix::kMaxColumns;

  // At most kMaxColumns.
  explicit StackedRows(int num_columns);

  // Where the next rows go, all of which the caller writes before anything else is called.
  template <int kRows>
  auto Next(Eigen::Index num_rows = kRows) {
    return Eigen::Map<Eigen::Matrix<double, kRows, Eigen::Dynamic>, 0, Eigen::OuterStride<kMaxRows>>(
        NextColumns(num_rows), num_rows, num_columns_);
  }
  // The first column's; each further one's are kMaxRows on.
  double* NextColumns(Eigen::Index num_rows);

  // Adds the products of all pairs of columns, below the diagonal only.
  void AddTo(Eigen::MatrixXd* matrix);
  // The products, symmetric.
  Eigen::MatrixXd Products();

 private:
  void Multiply();

  int num_columns_;
  Eigen::Index size_ = 0;  // Rows in `columns_`.
  GramMatrix products_;
  // One more pads an odd number.
  alignas(64) double columns_[kMaxColumns + 1][kMaxRows];
};

}  // namespace heba
