#include "heba/kernels/inverse_root.h"

#include "heba/base/factorisation.h"
#include "heba/kernels/gram_matrix.h"
#include "heba/kernels/small_matrix.h"

namespace heba {
namespace {

std::optional<Eigen::MatrixXd> RootByFactor(const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  const auto factor = Cholesky(matrix);
  if (!factor) return std::nullopt;
  return InverseOfLower(factor->lower());
}

// With the blocks A = [P, Q^T; Q, S] and the roots X of P and Y of S - Q X^T X Q^T, the root of A is
// [X, 0; -Y Q X^T X, Y].
std::optional<Eigen::MatrixXd> RootByBlocks(const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  const Eigen::Index size = matrix.rows();
  // Smaller matrices leave too little to the products.
  constexpr Eigen::Index kSmall = 24;
  if (size <= kSmall) return RootByFactor(matrix);
  const Eigen::Index half = size / 2;
  const Eigen::Index rest = size - half;
  const std::optional<Eigen::MatrixXd> upper = RootByBlocks(matrix.topLeftCorner(half, half));
  if (!upper) return std::nullopt;
  const Eigen::MatrixXd seen = InnerProducts(upper->transpose(), matrix.bottomLeftCorner(rest, half).transpose());
  const std::optional<Eigen::MatrixXd> lower =
      RootByBlocks(matrix.bottomRightCorner(rest, rest) - InnerProducts(seen, seen));
  if (!lower) return std::nullopt;
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(size, size);
  root.topLeftCorner(half, half) = *upper;
  root.bottomRightCorner(rest, rest) = *lower;
  root.bottomLeftCorner(rest, half) = -InnerProducts(lower->transpose(), InnerProducts(seen, *upper));
  return root;
}

}  // namespace

std::optional<Eigen::MatrixXd> InverseRootOf(const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  std::optional<Eigen::MatrixXd> root = RootByBlocks(matrix);
  // Rounding in the blocks grows with their condition; that of the factorisation does not.
  return root ? root : RootByFactor(matrix);
}

}  // namespace heba
