#include "solvers/closed_form/motion_analysis.h"

#include <algorithm>
#include <cmath>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
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

std::optional<Failure> WhyNotObservable(const MotionAnalysis& motion) {
  constexpr int kMinCaptures = 3;
  // Smaller rotations are robot noise and not motion: robots repeat to 0.01 deg and are accurate to 0.2 deg.
  const double min_rotation_rad = DegToRad(0.5);
  if (motion.num_captures < kMinCaptures) {
    return Failure{FailureCode("few_captures"), {{"captures", motion.num_captures}}};
  }
  const double first_deg = RadToDeg(motion.rotation_rms_rad[0]);
  if (motion.rotation_rms_rad[0] < min_rotation_rad) {
    return Failure{FailureCode("no_rotation"), {{"rms_deg", first_deg}}};
  }
  if (motion.rotation_rms_rad[1] < min_rotation_rad) {
    const Eigen::Vector3d& axis = motion.main_axis;
    return Failure{FailureCode("one_axis"),
                   {{"rms_deg", first_deg},
                    {"x", axis.x()},
                    {"y", axis.y()},
                    {"z", axis.z()},
                    {"other_deg", RadToDeg(motion.rotation_rms_rad[1])}}};
  }
  return std::nullopt;
}

}  // namespace heba
