// J^T J of a tall matrix with few columns, in one pass over its rows: the inner loop of every refinement.
#pragma once

#include <Eigen/Core>

namespace heba {

// Sums of the products of all pairs of columns.
class ColumnProducts {
 public:
  static constexpr int kMaxColumns = 40;
  // How far apart columns begin in what Add is given.
  explicit ColumnProducts(int num_columns, Eigen::Index stride);

  // Adds `num_rows` rows, which the caller pads with zeros to a multiple of kMaxLanes (heba/base/simd.h). Of an odd
  // number of columns there must be one more, which may hold anything.
  void Add(const double* columns, Eigen::Index num_rows);

  // The sums, symmetric.
  Eigen::MatrixXd Matrix() const;

 private:
  int num_columns_;
  Eigen::Index stride_;
  // As the kernels lay them out: block by block, each pair's lanes together.
  static constexpr int kMaxSums = kMaxColumns * (kMaxColumns + 4) / 2;
  alignas(64) double lanes_[kMaxSums * 8];
};

}  // namespace heba
