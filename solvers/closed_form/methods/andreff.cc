// N. Andreff, R. Horaud and B. Espiau, "On-line hand-eye calibration", 3DIM 1999. Solves equation (9), linear in the
// nine entries of R_X and in t_X at once, with vec by columns:
//   (I - R_B (x) R_A) vec(R_X) = 0,   (t_B^T (x) I) vec(R_X) + (I - R_A) t_X = t_A
// by least squares over all motions; R_X is then projected to the nearest rotation.
#include <Eigen/LU>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/known_rotation.h"

namespace heba {

Outcome<HandEye> SolveHandEye_andreff(const HandEyeInput& input) {
  // The sums over the motions of the products with these columns.
  const Eigen::MatrixXd& sums = input.motions().linear;
  constexpr auto kOne = MotionSums::kOne;
  constexpr auto kTranslationA = MotionSums::kTranslationA;
  constexpr auto kTranslationB = MotionSums::kTranslationB;
  const auto rotation_a = [](int column) { return MotionSums::kRotationA + 3 * column; };
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  // Returns the sum of R_A multiplied by 1, by an entry of R_B or by an entry of t_B.
  const auto with_rotation_a = [&](Eigen::Index row) -> Eigen::Matrix3d {
    const Eigen::Matrix<double, 9, 1> entries = sums.col(row).segment<9>(MotionSums::kRotationA);
    return Eigen::Map<const Eigen::Matrix3d>(entries.data());
  };
  Eigen::Matrix<double, 12, 12> normal;
  Eigen::Matrix<double, 12, 1> right;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      // (I - R_B (x) R_A)^T (I - R_B (x) R_A) = 2 I - R_B (x) R_A - (R_B (x) R_A)^T, and t_B t_B^T (x) I.
      normal.block<3, 3>(3 * i, 3 * j) = -with_rotation_a(MotionSums::kRotationB + 3 * j + i) -
                                         with_rotation_a(MotionSums::kRotationB + 3 * i + j).transpose() +
                                         sums(kTranslationB + i, kTranslationB + j) * identity;
    }
    normal.block<3, 3>(3 * i, 3 * i) += 2 * sums(kOne, kOne) * identity;
    const Eigen::Matrix3d with_translation =
        sums(kOne, kTranslationB + i) * identity - with_rotation_a(kTranslationB + i);
    normal.block<3, 3>(3 * i, 9) = with_translation;
    normal.block<3, 3>(9, 3 * i) = with_translation.transpose();
    right.segment<3>(3 * i) = sums.col(kTranslationB + i).segment<3>(kTranslationA);
    right[9 + i] = sums(kOne, kTranslationA + i) - sums.block<3, 3>(rotation_a(i), kTranslationA).trace();
  }
  const Eigen::Matrix3d sum_a = with_rotation_a(kOne);
  normal.bottomRightCorner<3, 3>() = 2 * sums(kOne, kOne) * identity - sum_a - sum_a.transpose();
  const Eigen::Matrix<double, 12, 1> solution = SolveSymmetric(normal, right);
  if (!solution.allFinite()) return Failure{FailureCode("no_solution"), {}, {{"equations", "linear"}}};
  const Eigen::Matrix3d linear = Eigen::Map<const Eigen::Matrix3d>(solution.data());
  if (!(linear.determinant() > 1e-6)) {
    return Failure{FailureCode("not_a_rotation")};
  }
  return WithAverageBoardPose(input.pairs(), {NearestRotation(linear), solution.tail<3>()});
}

}  // namespace heba
