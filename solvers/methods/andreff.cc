// N. Andreff, R. Horaud and B. Espiau, "On-line hand-eye calibration", 3DIM 1999. Linear in the nine entries of R_X and
// in t_X at once, equation (9), with vec by columns:
//   (I - R_B (x) R_A) vec(R_X) = 0,   (t_B^T (x) I) vec(R_X) + (I - R_A) t_X = t_A
// by least squares over all motions; R_X is then the nearest rotation.
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "solvers/relative_motion.h"

namespace heba {

Outcome<HandEye> SolveHandEye_andreff(const std::vector<PosePair>& pairs) {
  if (const std::optional<Failure> failure = CheckPairs(pairs)) return *failure;
  using Matrix12 = Eigen::Matrix<double, 12, 12>;
  Matrix12 normal = Matrix12::Zero();
  Eigen::Matrix<double, 12, 1> right = Eigen::Matrix<double, 12, 1>::Zero();
  ForEachMotion(pairs, [&](const Rigid3d& a, const Rigid3d& b) {
    const Eigen::Matrix3d r_a = a.RotationMatrix();
    const Eigen::Matrix3d r_b = b.RotationMatrix();
    Matrix12 left = Matrix12::Zero();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        left.block<3, 3>(3 * row, 3 * column) = -r_b(row, column) * r_a;
      }
      left.block<3, 3>(9, 3 * row) = b.translation[row] * Eigen::Matrix3d::Identity();
    }
    left.topLeftCorner<9, 9>() += Eigen::Matrix<double, 9, 9>::Identity();
    left.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() - r_a;
    normal += left.transpose() * left;
    right += left.bottomRows<3>().transpose() * a.translation;
  });
  const Eigen::Matrix<double, 12, 1> solution = normal.ldlt().solve(right);
  if (!solution.allFinite()) return Failure{"the linear equations have no solution"};
  const Eigen::Matrix3d linear = Eigen::Map<const Eigen::Matrix3d>(solution.data());
  if (!(linear.determinant() > 1e-6)) {
    return Failure{"the linear solution is no rotation (the translations say too little of the scale)"};
  }
  return WithMeanBoard(pairs, {NearestRotation(linear), solution.tail<3>()});
}

}  // namespace heba
