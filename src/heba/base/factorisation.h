// Factorisations of dense matrices, compiled once. Eigen's own are templates, of which each costs seconds of compile
// time in every file that uses it; the functions here take any dense expressions, evaluate them, and hand them to code
// that is not a template. The sizes 2, 3 and 6 have code of their own, so that small matrices cost no allocation.
#pragma once

#include <optional>
#include <utility>

#include <Eigen/Core>

namespace heba {

// The kernels: column-major arrays without gaps.
namespace kernels {
// Replaces `right`, size x columns, by matrix^-1 right; `matrix` is overwritten.
void SolveSymmetric(Eigen::Index size, double* matrix, Eigen::Index columns, double* right);
// Replaces the lower triangle of `matrix` by its Cholesky factor. Returns false if the matrix is not positive.
bool Cholesky(Eigen::Index size, double* matrix);
// Replaces `right` by L^-1 right, or by L^-T right; L is the lower triangle of `lower`.
void SolveLower(Eigen::Index size, const double* lower, Eigen::Index columns, double* right);
void SolveLowerTransposed(Eigen::Index size, const double* lower, Eigen::Index columns, double* right);
// Writes the ascending eigenvalues, and the eigenvectors as columns, of the matrix whose lower triangle is given.
void EigenSymmetric(Eigen::Index size, const double* matrix, double* values, double* vectors);
}  // namespace kernels

// Returns A^-1 B for a symmetric matrix A that is not negative, of which the lower triangle is read, by its L D L^T
// factorisation with pivoting. Where a pivot is zero, so is its part of the solution.
template <class A, class B>
Eigen::Matrix<double, A::RowsAtCompileTime, B::ColsAtCompileTime> SolveSymmetric(const Eigen::MatrixBase<A>& matrix,
                                                                                 const Eigen::MatrixBase<B>& right) {
  Eigen::Matrix<double, A::RowsAtCompileTime, A::ColsAtCompileTime> factored = matrix;
  Eigen::Matrix<double, A::RowsAtCompileTime, B::ColsAtCompileTime> solution = right;
  kernels::SolveSymmetric(factored.rows(), factored.data(), solution.cols(), solution.data());
  return solution;
}

// Returns the inverse of a symmetric matrix that is not negative, as SolveSymmetric.
template <class A>
Eigen::Matrix<double, A::RowsAtCompileTime, A::ColsAtCompileTime> InverseOfSymmetric(
    const Eigen::MatrixBase<A>& matrix) {
  using Square = Eigen::Matrix<double, A::RowsAtCompileTime, A::ColsAtCompileTime>;
  return SolveSymmetric(matrix, Square::Identity(matrix.rows(), matrix.cols()));
}

// Returns d^T A^-1 d for a covariance A: the square of the Mahalanobis distance.
template <class D, class A>
double MahalanobisSquare(const Eigen::MatrixBase<D>& difference, const Eigen::MatrixBase<A>& covariance) {
  const Eigen::Matrix<double, A::RowsAtCompileTime, 1> d = difference;
  return d.dot(SolveSymmetric(covariance, d));
}

// The Cholesky factorisation A = L L^T of a positive matrix.
template <int kSize>
class CholeskyFactor {
 public:
  using Square = Eigen::Matrix<double, kSize, kSize>;

  // Returns nothing if A, of which the lower triangle is read, is not positive.
  template <class A>
  static std::optional<CholeskyFactor> Of(const Eigen::MatrixBase<A>& matrix) {
    CholeskyFactor factor;
    factor.lower_ = matrix;
    if (!kernels::Cholesky(factor.lower_.rows(), factor.lower_.data())) return std::nullopt;
    return factor;
  }

  // Returns the factorisation of I + B B^T, by way of the QR decomposition of [B I]^T: rounding, which makes the sum
  // itself singular where B is large, does not matter.
  static CholeskyFactor OfIdentityPlusSquare(const Eigen::MatrixXd& b);

  // Returns a matrix whose lower triangle is L; the rest has no meaning.
  const Square& lower() const { return lower_; }
  // Returns log |A|.
  double LogDeterminant() const { return 2 * lower_.diagonal().array().log().sum(); }
  // Returns A^-1 B.
  template <class B>
  Eigen::Matrix<double, kSize, B::ColsAtCompileTime> Solve(const Eigen::MatrixBase<B>& right) const {
    Eigen::Matrix<double, kSize, B::ColsAtCompileTime> solution = right;
    kernels::SolveLower(lower_.rows(), lower_.data(), solution.cols(), solution.data());
    kernels::SolveLowerTransposed(lower_.rows(), lower_.data(), solution.cols(), solution.data());
    return solution;
  }
  // Returns L^-1 B.
  template <class B>
  Eigen::Matrix<double, kSize, B::ColsAtCompileTime> SolveLower(const Eigen::MatrixBase<B>& right) const {
    Eigen::Matrix<double, kSize, B::ColsAtCompileTime> solution = right;
    kernels::SolveLower(lower_.rows(), lower_.data(), solution.cols(), solution.data());
    return solution;
  }
  // Returns L^-T B.
  template <class B>
  Eigen::Matrix<double, kSize, B::ColsAtCompileTime> SolveLowerTransposed(const Eigen::MatrixBase<B>& right) const {
    Eigen::Matrix<double, kSize, B::ColsAtCompileTime> solution = right;
    kernels::SolveLowerTransposed(lower_.rows(), lower_.data(), solution.cols(), solution.data());
    return solution;
  }
  // Returns A^-1.
  Square Inverse() const { return Solve(Square::Identity(lower_.rows(), lower_.cols())); }

 private:
  CholeskyFactor() = default;
  Square lower_;
};

// Returns the Cholesky factorisation; nothing if the matrix is not positive.
template <class A>
std::optional<CholeskyFactor<A::RowsAtCompileTime>> Cholesky(const Eigen::MatrixBase<A>& matrix) {
  return CholeskyFactor<A::RowsAtCompileTime>::Of(matrix);
}

// The eigenvalues of a symmetric matrix, ascending, and its eigenvectors as the columns in the same order.
template <int kSize>
struct SymmetricEigen {
  Eigen::Matrix<double, kSize, 1> values;
  Eigen::Matrix<double, kSize, kSize> vectors;

  // Returns the symmetric root of the matrix, or the inverse of that root; the matrix must be positive.
  Eigen::Matrix<double, kSize, kSize> Root() const {
    return vectors * values.cwiseSqrt().asDiagonal() * vectors.transpose();
  }
  Eigen::Matrix<double, kSize, kSize> InverseRoot() const {
    return vectors * values.cwiseSqrt().cwiseInverse().asDiagonal() * vectors.transpose();
  }
};

// Returns the eigenvalues and eigenvectors of a symmetric matrix, of which the lower triangle is read.
template <class A>
SymmetricEigen<A::RowsAtCompileTime> EigenOfSymmetric(const Eigen::MatrixBase<A>& matrix) {
  const Eigen::Matrix<double, A::RowsAtCompileTime, A::ColsAtCompileTime> evaluated = matrix;
  SymmetricEigen<A::RowsAtCompileTime> eigen;
  eigen.values.resize(evaluated.rows());
  eigen.vectors.resize(evaluated.rows(), evaluated.rows());
  kernels::EigenSymmetric(evaluated.rows(), evaluated.data(), eigen.values.data(), eigen.vectors.data());
  return eigen;
}

// The factorisation A = Q R of a matrix by Householder reflections.
class HouseholderFactor {
 public:
  explicit HouseholderFactor(Eigen::MatrixXd matrix);

  // Returns R: the upper triangle of the first min(rows, columns) rows.
  Eigen::MatrixXd R() const;
  // Returns Q^T `right`.
  Eigen::MatrixXd Rotated(Eigen::MatrixXd right) const;
  // Returns the first min(rows, columns) columns of Q: a basis of the space of A's columns.
  Eigen::MatrixXd Basis() const;

 private:
  Eigen::MatrixXd factors_;  // The upper triangle is R; below it are the vectors of the reflections.
  Eigen::VectorXd scales_;   // Each reflection has a scale.
};

template <int kSize>
CholeskyFactor<kSize> CholeskyFactor<kSize>::OfIdentityPlusSquare(const Eigen::MatrixXd& b) {
  Eigen::MatrixXd stacked(b.cols() + b.rows(), b.rows());
  stacked << b.transpose(), Eigen::MatrixXd::Identity(b.rows(), b.rows());
  CholeskyFactor factor;
  factor.lower_ = HouseholderFactor(std::move(stacked)).R().transpose();
  for (Eigen::Index i = 0; i < b.rows(); ++i) {
    if (factor.lower_(i, i) < 0) factor.lower_.col(i) *= -1;
  }
  return factor;
}

}  // namespace heba
