// A. Li, L. Wang and D. Wu, "Simultaneous robot-world and hand-eye calibration using dual-quaternions and Kronecker
// product", International Journal of the Physical Sciences 5(10), 2010, in the Kronecker form. Solves for all 24
// unknowns of M Z = X C at once, with vec by columns:
//   (I (x) R_M) vec(R_Z) - (R_C^T (x) I) vec(R_X) = 0,   R_M t_Z - (t_C^T (x) I) vec(R_X) - t_X = -t_M
// by least squares. The rotations are then projected to the nearest ones; the translations are not changed.
#include <Eigen/LU>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/known_rotation.h"

namespace heba {

Outcome<HandEye> SolveHandEye_li(const HandEyeInput& input) {
  const std::vector<PosePair>& pairs = input.pairs();
  using Matrix24 = Eigen::Matrix<double, 24, 24>;
  Matrix24 normal = Matrix24::Zero();
  Eigen::Matrix<double, 24, 1> right = Eigen::Matrix<double, 24, 1>::Zero();
  for (const PosePair& pair : pairs) {
    const Eigen::Matrix3d r_m = pair.camera_mount_from_target_mount.RotationMatrix();
    const Eigen::Matrix3d r_c = pair.camera_from_target.RotationMatrix();
    // Columns: vec(R_Z), vec(R_X), t_Z, t_X.
    Eigen::Matrix<double, 12, 24> left = Eigen::Matrix<double, 12, 24>::Zero();
    for (int row = 0; row < 3; ++row) {
      left.block<3, 3>(3 * row, 3 * row) = r_m;
      for (int column = 0; column < 3; ++column) {
        left.block<3, 3>(3 * row, 9 + 3 * column) = -r_c(column, row) * Eigen::Matrix3d::Identity();
      }
      left.block<3, 3>(9, 9 + 3 * row) = -pair.camera_from_target.translation[row] * Eigen::Matrix3d::Identity();
    }
    left.block<3, 3>(9, 18) = r_m;
    left.block<3, 3>(9, 21) = -Eigen::Matrix3d::Identity();
    normal += left.transpose() * left;
    right -= left.bottomRows<3>().transpose() * pair.camera_mount_from_target_mount.translation;
  }
  const Eigen::Matrix<double, 24, 1> solution = SolveSymmetric(normal, right);
  if (!solution.allFinite()) return Failure{FailureCode("no_solution"), {}, {{"equations", "linear"}}};
  const Eigen::Matrix3d linear_z = Eigen::Map<const Eigen::Matrix3d>(solution.data());
  const Eigen::Matrix3d linear_x = Eigen::Map<const Eigen::Matrix3d>(solution.data() + 9);
  if (!(linear_x.determinant() > 1e-6) || !(linear_z.determinant() > 1e-6)) {
    return Failure{FailureCode("not_a_rotation")};
  }
  return HandEye{Rigid3d(NearestRotation(linear_x), solution.tail<3>()),
                 Rigid3d(NearestRotation(linear_z), solution.segment<3>(18))};
}

}  // namespace heba
