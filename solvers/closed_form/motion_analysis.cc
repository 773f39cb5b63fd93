#include "solvers/closed_form/motion_analysis.h"

#include <algorithm>
#include <cmath>

#include "heba/base/factorisation.h"
#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {

MotionAnalysis AnalyseMotion(const std::vector<Rigid3d>& poses) {
  MotionAnalysis motion;
  motion.num_captures = static_cast<int>(poses.size());
  if (poses.empty()) return motion;
  const Rigid3d mean = MeanPose(poses);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  double translation_sum = 0;
  for (const Rigid3d& pose : poses) {
    const Eigen::Vector3d rotation_vector = LogRotation(mean.rotation.conjugate() * pose.rotation);
    scatter += rotation_vector * rotation_vector.transpose();
    translation_sum += (pose.translation - mean.translation).squaredNorm();
  }
  const double n = static_cast<double>(poses.size());
  const SymmetricEigen<3> eigen = EigenOfSymmetric(scatter / n);
  motion.rotation_rms_rad = eigen.values.cwiseMax(0).cwiseSqrt().reverse();
  motion.main_axis = eigen.vectors.col(2);
  motion.translation_rms_m = std::sqrt(translation_sum / n);
  return motion;
}

std::string WhyNotObservable(const MotionAnalysis& motion) {
  constexpr int kMinCaptures = 3;
  // Smaller rotations are robot noise and not motion: robots repeat to 0.01 deg and are accurate to 0.2 deg.
  const double min_rotation_rad = DegToRad(0.5);
  if (motion.num_captures < kMinCaptures) {
    return "at least 3 captures with the target are needed, there " +
           std::string(motion.num_captures == 1 ? "is " : "are ") + std::to_string(motion.num_captures);
  }
  const double first_deg = RadToDeg(motion.rotation_rms_rad[0]);
  const double second_deg = RadToDeg(motion.rotation_rms_rad[1]);
  if (motion.rotation_rms_rad[0] < min_rotation_rad) {
    return "the robot did not rotate between the captures (" + Fixed(first_deg, 2) +
           " deg rms), so the hand-eye pose is undetermined; rotate the gripper about two different axes by 20 deg or "
           "more";
  }
  if (motion.rotation_rms_rad[1] < min_rotation_rad) {
    const Eigen::Vector3d& axis = motion.main_axis;
    return "the robot rotated about one axis only (" + Fixed(first_deg, 1) + " deg rms about [" + Fixed(axis.x(), 2) +
           ", " + Fixed(axis.y(), 2) + ", " + Fixed(axis.z(), 2) + "], " + Fixed(second_deg, 2) +
           " deg about any other), so the translation of the hand-eye pose along that axis is undetermined; rotate the "
           "gripper about a second axis by 20 deg or more";
  }
  return "";
}

}  // namespace heba
