#include "solvers/relative_motion.h"

#include <algorithm>

#include <Eigen/Cholesky>

#include "heba/base/units.h"
#include "solvers/motion_analysis.h"

namespace heba {

double MinMotionAngleRad(const std::vector<PosePair>& pairs) {
  double largest = 0;
  for (size_t i = 0; i < pairs.size(); ++i) {
    for (size_t j = i + 1; j < pairs.size(); ++j) {
      largest =
          std::max(largest, AngleRad(pairs[i].camera_mount_from_target_mount, pairs[j].camera_mount_from_target_mount));
    }
  }
  return std::min(DegToRad(5.0), 0.25 * largest);
}

bool CarriesInformation(const Rigid3d& a, const Rigid3d& b, double min_angle_rad) {
  const double max_angle_rad = DegToRad(170.0);
  const double angle_a = RotationAngle(a.rotation);
  const double angle_b = RotationAngle(b.rotation);
  return std::min(angle_a, angle_b) >= min_angle_rad && std::max(angle_a, angle_b) <= max_angle_rad;
}

std::optional<Failure> CheckPairs(const std::vector<PosePair>& pairs) {
  std::vector<Rigid3d> poses;
  poses.reserve(pairs.size());
  for (const PosePair& pair : pairs) poses.push_back(pair.camera_mount_from_target_mount);
  const std::string why = WhyNotObservable(AnalyseMotion(poses));
  if (!why.empty()) return Failure{why};
  return std::nullopt;
}

Eigen::Vector3d SolveTranslation(const std::vector<PosePair>& pairs, const Eigen::Matrix3d& rotation_x) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  ForEachMotion(pairs, [&](const Rigid3d& a, const Rigid3d& b) {
    const Eigen::Matrix3d left = a.RotationMatrix() - Eigen::Matrix3d::Identity();
    normal += left.transpose() * left;
    right += left.transpose() * (rotation_x * b.translation - a.translation);
  });
  return normal.ldlt().solve(right);
}

HandEye WithMeanBoard(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera) {
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
  const Eigen::Matrix<double, 6, 1> translations = normal.ldlt().solve(right);
  return {Rigid3d(rotation_x, translations.tail<3>()), Rigid3d(rotation_z, translations.head<3>())};
}

}  // namespace heba
