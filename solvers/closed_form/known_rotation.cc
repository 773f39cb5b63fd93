#include "solvers/closed_form/known_rotation.h"

#include "heba/base/factorisation.h"

namespace heba {

Eigen::Vector3d SolveTranslation(const MotionSums& motions, const Eigen::Matrix3d& rotation_x) {
  // (R_A - I)^T (R_A - I) = 2 I - R_A - R_A^T.
  const Eigen::VectorXd ones = motions.linear.col(MotionSums::kOne);
  const Eigen::Matrix3d sum_a = Eigen::Map<const Eigen::Matrix3d>(&ones[MotionSums::kRotationA]);
  const Eigen::Matrix3d normal =
      2 * motions.Count() * Eigen::Matrix3d::Identity() - sum_a - Eigen::Matrix3d(sum_a.transpose());
  Eigen::Vector3d right = ones.segment<3>(MotionSums::kTranslationA) -
                          rotation_x * Eigen::Vector3d(ones.segment<3>(MotionSums::kTranslationB));
  for (int k = 0; k < 3; ++k) {
    // The products of column k of R_A with t_B and with t_A.
    const Eigen::Index column = MotionSums::kRotationA + 3 * k;
    right[k] += rotation_x.cwiseProduct(motions.linear.block<3, 3>(column, MotionSums::kTranslationB)).sum() -
                motions.linear.block<3, 3>(column, MotionSums::kTranslationA).trace();
  }
  return SolveSymmetric(normal, right);
}

HandEye WithAverageBoardPose(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera) {
  std::vector<Rigid3d> boards;
  boards.reserve(pairs.size());
  for (const PosePair& pair : pairs) {
    boards.push_back(Inverse(pair.camera_mount_from_target_mount) * camera_mount_from_camera * pair.camera_from_target);
  }
  return {camera_mount_from_camera, MeanPose(boards)};
}

HandEye SolveTranslations(const std::vector<PosePair>& pairs, const Eigen::Matrix3d& rotation_x,
                          const Eigen::Matrix3d& rotation_z) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  for (const PosePair& pair : pairs) {
    Eigen::Matrix<double, 3, 6> left;
    left << pair.camera_mount_from_target_mount.RotationMatrix(), -Eigen::Matrix3d::Identity();
    normal += left.transpose() * left;
    right += left.transpose() *
             (rotation_x * pair.camera_from_target.translation - pair.camera_mount_from_target_mount.translation);
  }
  const Eigen::Matrix<double, 6, 1> translations = SolveSymmetric(normal, right);
  return {Rigid3d(rotation_x, translations.tail<3>()), Rigid3d(rotation_z, translations.head<3>())};
}

}  // namespace heba
