// The inverse of the Cholesky factor of a matrix of tens to hundreds of columns, from products that use the instruction
// set of the machine.
#pragma once

#include <optional>

#include <Eigen/Core>

namespace heba {

// Returns the lower triangular matrix X = L^-1 of the factorisation A = L L^T, such that the inverse of A is X^T X and
// log |A| is -2 times the sum of the logarithms of X's diagonal. Nothing if A, of which the lower triangle is read, is
// not positive.
std::optional<Eigen::MatrixXd> InverseRootOf(const Eigen::Ref<const Eigen::MatrixXd>& matrix);

}  // namespace heba
