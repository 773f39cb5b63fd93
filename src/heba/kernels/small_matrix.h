// Types of small matrices, and solvers for triangular systems that are so small that the blocked algorithms of Eigen
// cost more than the arithmetic.
#pragma once

#include <Eigen/Core>

namespace heba {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Replaces B by L^-1 B. L is the lower triangle of `lower`, and its diagonal must not contain a zero.
template <class Lower>
void SolveLowerInPlace(const Lower& lower, RowMajorMatrix* b) {
  for (Eigen::Index r = 0; r < b->rows(); ++r) {
    for (Eigen::Index k = 0; k < r; ++k) b->row(r) -= lower(r, k) * b->row(k);
    b->row(r) /= lower(r, r);
  }
}

// Returns L^-1, where L is the lower triangle of `lower`.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> InverseOfLower(const Eigen::Matrix<double, kSize, kSize>& lower) {
  const Eigen::Index size = lower.rows();
  Eigen::Matrix<double, kSize, kSize> inverse = Eigen::Matrix<double, kSize, kSize>::Zero(size, size);
  for (Eigen::Index c = 0; c < size; ++c) {
    inverse(c, c) = 1 / lower(c, c);
    for (Eigen::Index r = c + 1; r < size; ++r) {
      double sum = 0;
      for (Eigen::Index k = c; k < r; ++k) sum += lower(r, k) * inverse(k, c);
      inverse(r, c) = -sum / lower(r, r);
    }
  }
  return inverse;
}

}  // namespace heba
