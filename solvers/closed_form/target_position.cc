#include "solvers/closed_form/target_position.h"

#include <Eigen/LU>

#include "heba/base/factorisation.h"
#include "solvers/closed_form/known_rotation.h"

namespace heba {
namespace {

// Returns the covariance of a point that is fixed in the target, m^2 for a pixel noise of 1 px.
Eigen::Matrix3d CovarianceAt(const PosePair& pair, const Eigen::Vector3d& in_camera) {
  const Eigen::Matrix<double, 3, 6> j = PointByMotion(in_camera);
  return j * *pair.covariance_at_1px * j.transpose();
}

// Returns the point with the minimal sum of log det of its covariances, by majorisation: log det is concave, so the
// sum of traces weighted with the inverse covariances at the current point is an upper bound up to a constant. It is
// quadratic in the point's x and y, and its minimum is the next point.
Eigen::Vector3d BestKnownPoint(const std::vector<PosePair>& pairs) {
  constexpr double kStepM = 0.1;
  constexpr int kMaxIterations = 50;
  constexpr double kSmallStepM = 1e-6;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    std::vector<Eigen::Matrix3d> weights;
    for (const PosePair& pair : pairs) {
      weights.emplace_back(pair.covariance_at_1px ? CovarianceAt(pair, pair.camera_from_target * point).inverse().eval()
                                                  : Eigen::Matrix3d::Zero());
    }
    const auto sum_at = [&](double x, double y) {
      double sum = 0;
      for (size_t i = 0; i < pairs.size(); ++i) {
        if (!pairs[i].covariance_at_1px) continue;
        const Eigen::Vector3d in_camera = pairs[i].camera_from_target * (point + Eigen::Vector3d(x, y, 0));
        sum += (weights[i] * CovarianceAt(pairs[i], in_camera)).trace();
      }
      return sum;
    };
    // The coefficients of the quadratic, from its values at six points.
    const double h = kStepM;
    const double f00 = sum_at(0, 0);
    const double fp0 = sum_at(h, 0);
    const double fm0 = sum_at(-h, 0);
    const double f0p = sum_at(0, h);
    const double f0m = sum_at(0, -h);
    Eigen::Matrix2d second;
    second(0, 0) = fp0 - 2 * f00 + fm0;
    second(1, 1) = f0p - 2 * f00 + f0m;
    second(0, 1) = sum_at(h, h) - fp0 - f0p + f00;
    second(1, 0) = second(0, 1);
    const auto factor = Cholesky(second);
    if (!factor) break;
    const Eigen::Vector2d step = -h * factor->Solve(0.5 * Eigen::Vector2d(fp0 - fm0, f0p - f0m));
    point.head<2>() += step;
    if (step.norm() < kSmallStepM) break;
  }
  return point;
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
      position.covariance_at_1px = CovarianceAt(pair, position.in_camera);
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

HandEye WithBoardAtPoint(const std::vector<PosePair>& pairs, const Rigid3d& camera_mount_from_camera,
                         const Eigen::Vector3d& point_in_target, const Eigen::Vector3d& point_in_mount) {
  HandEye hand_eye = WithAverageBoardPose(pairs, camera_mount_from_camera);
  Rigid3d& board = hand_eye.target_mount_from_target;
  board.translation = point_in_mount - board.rotation * point_in_target;
  return hand_eye;
}

}  // namespace heba
