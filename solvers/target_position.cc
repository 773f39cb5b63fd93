#include "solvers/target_position.h"

#include <Eigen/Cholesky>

#include "solvers/relative_motion.h"

namespace heba {
namespace {

using Matrix36 = Eigen::Matrix<double, 3, 6>;

// How a point at `in_camera` moves with a left perturbation of camera_from_target.
Matrix36 PointFromTangent(const Eigen::Vector3d& in_camera) {
  Matrix36 matrix;
  matrix << Eigen::Matrix3d::Identity(), -Skew(in_camera);
  return matrix;
}

// The sum of the traces is a quadratic in the point's x and y: its minimum by its values at six places.
Eigen::Vector3d BestKnownPoint(const std::vector<PosePair>& pairs) {
  constexpr double kStepM = 0.1;
  const auto trace_at = [&](double x, double y) {
    double sum = 0;
    for (const PosePair& pair : pairs) {
      if (!pair.covariance_at_1px) continue;
      const Matrix36 j = PointFromTangent(pair.camera_from_target * Eigen::Vector3d(x, y, 0));
      sum += (j * *pair.covariance_at_1px * j.transpose()).trace();
    }
    return sum;
  };
  const double h = kStepM;
  const double f00 = trace_at(0, 0);
  const double fp0 = trace_at(h, 0);
  const double fm0 = trace_at(-h, 0);
  const double f0p = trace_at(0, h);
  const double f0m = trace_at(0, -h);
  const double fpp = trace_at(h, h);
  Eigen::Matrix2d second;
  second(0, 0) = fp0 - 2 * f00 + fm0;
  second(1, 1) = f0p - 2 * f00 + f0m;
  second(0, 1) = fpp - fp0 - f0p + f00;
  second(1, 0) = second(0, 1);
  const Eigen::LLT<Eigen::Matrix2d> factor(second);
  if (factor.info() != Eigen::Success) return Eigen::Vector3d::Zero();
  const Eigen::Vector2d step = -factor.solve(0.5 * Eigen::Vector2d(fp0 - fm0, f0p - f0m));
  return {h * step.x(), h * step.y(), 0};
}

}  // namespace

TargetPositions BestKnownPositions(const std::vector<PosePair>& pairs) {
  TargetPositions positions;
  positions.point_in_target = BestKnownPoint(pairs);
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  int num_known = 0;
  for (const PosePair& pair : pairs) {
    TargetPosition position{pair.camera_from_target * positions.point_in_target, Eigen::Matrix3d::Zero()};
    if (pair.covariance_at_1px) {
      const Matrix36 j = PointFromTangent(position.in_camera);
      position.covariance_at_1px = j * *pair.covariance_at_1px * j.transpose();
      sum += position.covariance_at_1px;
      ++num_known;
    }
    positions.captures.push_back(position);
  }
  const Eigen::Matrix3d typical =
      Eigen::Matrix3d::Identity() * (num_known == 0 ? 1.0 : sum.trace() / (3.0 * num_known));
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (!pairs[i].covariance_at_1px) positions.captures[i].covariance_at_1px = typical;
  }
  return positions;
}

HandEye WithBoardThrough(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera,
                         const Eigen::Vector3d& point_in_target, const Eigen::Vector3d& point_in_mount) {
  HandEye hand_eye = WithMeanBoard(pairs, camera_mount_from_camera);
  Rigid3d& board = hand_eye.target_mount_from_target;
  board.translation = point_in_mount - board.rotation * point_in_target;
  return hand_eye;
}

}  // namespace heba
