#include "heba/base/factorisation.h"

#include <type_traits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Householder>
#include <Eigen/QR>

namespace heba {
namespace kernels {
namespace {

// Calls function(size) with the size as a constant if it has code of its own, or with Eigen::Dynamic.
template <class Function>
auto BySize(Eigen::Index size, const Function& function) {
  switch (size) {
    case 2:
      return function(std::integral_constant<int, 2>());
    case 3:
      return function(std::integral_constant<int, 3>());
    case 6:
      return function(std::integral_constant<int, 6>());
    default:
      return function(std::integral_constant<int, Eigen::Dynamic>());
  }
}

template <int kSize>
using Square = Eigen::Map<Eigen::Matrix<double, kSize, kSize>>;
template <int kSize>
using ConstSquare = Eigen::Map<const Eigen::Matrix<double, kSize, kSize>>;
// Eigen's decompositions of this type overwrite the matrix.
template <int kSize>
using InPlace = Eigen::Ref<Eigen::Matrix<double, kSize, kSize>>;

// Replaces `right` by the solution; a single column has code of its own.
template <int kSize, class Solve>
void SolveInPlace(Eigen::Index size, Eigen::Index columns, double* right, const Solve& solve) {
  if (columns == 1) {
    Eigen::Map<Eigen::Matrix<double, kSize, 1>> column(right, size);
    solve(column);
  } else {
    Eigen::Map<Eigen::Matrix<double, kSize, Eigen::Dynamic>> all(right, size, columns);
    solve(all);
  }
}

}  // namespace

void SolveSymmetric(Eigen::Index size, double* matrix, Eigen::Index columns, double* right) {
  BySize(size, [&](auto constant) {
    constexpr int kSize = decltype(constant)::value;
    const auto solve = [&](auto square) {
      const Eigen::LDLT<decltype(square)> factor(square);
      SolveInPlace<kSize>(size, columns, right, [&](auto& b) { factor.solveInPlace(b); });
    };
    if constexpr (kSize == Eigen::Dynamic) {
      // Matrices of moderate size need no allocation.
      constexpr int kModerate = 16;
      if (size <= kModerate) {
        using Moderate = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kModerate, kModerate>;
        solve(Eigen::Ref<Moderate>(Eigen::Map<Moderate>(matrix, size, size)));
        return;
      }
    }
    solve(InPlace<kSize>(Square<kSize>(matrix, size, size)));
  });
}

bool Cholesky(Eigen::Index size, double* matrix) {
  return BySize(size, [&](auto constant) {
    constexpr int kSize = decltype(constant)::value;
    InPlace<kSize> square(Square<kSize>(matrix, size, size));
    return Eigen::LLT<InPlace<kSize>>(square).info() == Eigen::Success;
  });
}

void SolveLower(Eigen::Index size, const double* lower, Eigen::Index columns, double* right) {
  BySize(size, [&](auto constant) {
    constexpr int kSize = decltype(constant)::value;
    const ConstSquare<kSize> square(lower, size, size);
    SolveInPlace<kSize>(size, columns, right,
                        [&](auto& b) { square.template triangularView<Eigen::Lower>().solveInPlace(b); });
  });
}

void SolveLowerTransposed(Eigen::Index size, const double* lower, Eigen::Index columns, double* right) {
  BySize(size, [&](auto constant) {
    constexpr int kSize = decltype(constant)::value;
    const ConstSquare<kSize> square(lower, size, size);
    SolveInPlace<kSize>(size, columns, right,
                        [&](auto& b) { square.transpose().template triangularView<Eigen::Upper>().solveInPlace(b); });
  });
}

void EigenSymmetric(Eigen::Index size, const double* matrix, double* values, double* vectors) {
  BySize(size, [&](auto constant) {
    constexpr int kSize = decltype(constant)::value;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, kSize, kSize>> eigen(
        ConstSquare<kSize>(matrix, size, size));
    Eigen::Map<Eigen::Matrix<double, kSize, 1>>(values, size) = eigen.eigenvalues();
    Square<kSize>(vectors, size, size) = eigen.eigenvectors();
  });
}

}  // namespace kernels

HouseholderFactor::HouseholderFactor(Eigen::MatrixXd matrix) {
  Eigen::Ref<Eigen::MatrixXd> in_place(matrix);
  scales_ = Eigen::HouseholderQR<Eigen::Ref<Eigen::MatrixXd>>(in_place).hCoeffs();
  factors_ = std::move(matrix);
}

Eigen::MatrixXd HouseholderFactor::R() const { return factors_.topRows(scales_.size()).triangularView<Eigen::Upper>(); }

Eigen::MatrixXd HouseholderFactor::Rotated(Eigen::MatrixXd right) const {
  right.applyOnTheLeft(Eigen::householderSequence(factors_, scales_).adjoint());
  return right;
}

Eigen::MatrixXd HouseholderFactor::Basis() const {
  return Eigen::householderSequence(factors_, scales_) * Eigen::MatrixXd::Identity(factors_.rows(), scales_.size());
}

}  // namespace heba
