// M. Shah, "Solving the robot-world/hand-eye calibration problem using the Kronecker product", ASME Journal of
// Mechanisms and Robotics 5(3), 2013. From R_X R_C = R_M R_Z it follows, with K = sum R_C (x) R_M (vec by columns),
// that vec(R_Z) and vec(R_X) are the right and left singular vectors of the largest singular value of K. Both are
// projected to the nearest rotations; the two translations follow by linear least squares.
#include <Eigen/LU>
#include <Eigen/SVD>

#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/known_rotation.h"

namespace heba {
namespace {

// Returns the rotation nearest to a singular vector, read as a matrix whose sign and scale are arbitrary.
Eigen::Matrix3d RotationFromVector(const Eigen::Matrix<double, 9, 1>& vector) {
  const Eigen::Matrix3d matrix = Eigen::Map<const Eigen::Matrix3d>(vector.data());
  return NearestRotation(matrix.determinant() < 0 ? Eigen::Matrix3d(-matrix) : matrix);
}

}  // namespace

Outcome<HandEye> SolveHandEye_shah(const HandEyeInput& input) {
  const std::vector<PosePair>& pairs = input.pairs();
  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  Matrix9 k = Matrix9::Zero();
  for (const PosePair& pair : pairs) {
    const Eigen::Matrix3d r_m = pair.camera_mount_from_target_mount.RotationMatrix();
    const Eigen::Matrix3d r_c = pair.camera_from_target.RotationMatrix();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) k.block<3, 3>(3 * row, 3 * column) += r_c(row, column) * r_m;
    }
  }
  // vec(R_M R_Z R_C^T) = (R_C (x) R_M) vec(R_Z).
  const Eigen::JacobiSVD<Matrix9> svd(k, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return SolveTranslations(pairs, RotationFromVector(svd.matrixU().col(0)), RotationFromVector(svd.matrixV().col(0)));
}

}  // namespace heba
