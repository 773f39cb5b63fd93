// The Gram matrix J^T J of a tall matrix with few columns, computed in one pass over its rows. This is the inner loop
// of every refinement.
#pragma once

#include <limits>

#include <Eigen/Core>

#include "heba/kernels/simd.h"

namespace heba {

// Returns A^T B for matrices of tens to hundreds of columns, by the instruction set of the machine.
Eigen::MatrixXd InnerProducts(const Eigen::Ref<const Eigen::MatrixXd>& a, const Eigen::Ref<const Eigen::MatrixXd>& b);

// The number of columns of AddGramOfMany is a multiple of this.
inline constexpr int kManyColumnsUnit = 4;

// Adds the inner products of all pairs of many columns to the lower triangle of `products`; what becomes of the rest
// has no meaning. Column i starts at `columns` + i * `stride`. The caller pads the rows with zeros to a multiple of
// kMaxLanes (heba/kernels/simd.h), and the columns to one of kManyColumnsUnit.
void AddGramOfMany(const double* columns, Eigen::Index stride, Eigen::Index num_rows, Eigen::MatrixXd* products);

// Accumulates the inner products of all pairs of a few columns.
class GramMatrix {
 public:
  static constexpr int kMaxColumns = 40;
  // `stride`: distance between the starts of two columns in the array that is passed to Add, in doubles. `most_rows`:
  // the largest number of rows that will be added in total; for very few rows, narrower SIMD lanes are used.
  GramMatrix(int num_columns, Eigen::Index stride, Eigen::Index most_rows = std::numeric_limits<int>::max());

  // Adds `num_rows` rows, which the caller pads with zeros to a multiple of kMaxLanes (heba/kernels/simd.h). If the
  // number of columns is odd, one more column must exist in memory; its values do not matter.
  void Add(const double* columns, Eigen::Index num_rows);

  // Returns the sums as a symmetric matrix.
  Eigen::MatrixXd Matrix() const;
  // Adds `scale` times the sums to the lower triangle of `matrix`. Column i of the sums belongs to row and column
  // `places[i]` of `matrix`; `places` must be ascending.
  void AddTo(const int* places, double scale, Eigen::MatrixXd* matrix) const;

 private:
  int num_columns_;
  Eigen::Index stride_;
  Simd set_;
  // The sums in the layout of the kernels: block by block, with the lanes of each pair of columns together.
  static constexpr int kMaxSums = kMaxColumns * (kMaxColumns + 4) / 2;
  alignas(64) double lanes_[kMaxSums * kMaxLanes];
};

}  // namespace heba
