// J^T J of a tall matrix with few columns, in one pass over its rows: the inner loop of every refinement.
#pragma once

#include <limits>

#include <Eigen/Core>

#include "heba/kernels/simd.h"

namespace heba {

// Sums of the products of all pairs of columns.
class GramMatrix {
 public:
  static constexpr int kMaxColumns = 40;
  // `stride`: how far apart columns begin in what Add is given; `most_rows`: that it is given in all.
  GramMatrix(int num_columns, Eigen::Index stride, Eigen::Index most_rows = std::numeric_limits<int>::max());

  // Adds `num_rows` rows, which the caller pads with zeros to a multiple of kMaxLanes (heba/kernels/simd.h). Of an odd
  // number of columns there must be one more, which may hold anything.
  void Add(const double* columns, Eigen::Index num_rows);

  // The sums, symmetric.
  Eigen::MatrixXd Matrix() const;
  // Adds `scale` times them to `matrix`, a column being that of the matrix which `places` says, in ascending order;
  // below its diagonal only.
  void AddTo(const int* places, double scale, Eigen::MatrixXd* matrix) const;

 private:
  int num_columns_;
  Eigen::Index stride_;
  Simd set_;
  // As the kernels lay them out: block by block, each pair's lanes together.
  static constexpr int kMaxSums = kMaxColumns * (kMaxColumns + 4) / 2;
  alignas(64) double lanes_[kMaxSums * kMaxLanes];
};

}  // namespace heba
