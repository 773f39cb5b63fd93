// K. Daniilidis, "Hand-eye calibration using dual quaternions", International Journal of Robotics Research 18(3),
// 1999. The screws of a motion, a + epsilon a' as reported by the robot and b + epsilon b' as seen by the camera
// (vector parts of the dual quaternions), give six equations in the dual quaternion q + epsilon q' of X, equation
// (31):
//   [a - b, skew(a + b), 0, 0; a' - b', skew(a' + b'), a - b, skew(a + b)] [q; q'] = 0.
// The solution lies in the span of the two right singular vectors of the smallest singular values; q q = 1 and q q' =
// 0 determine it (equations (34) to (37)).
#include <cmath>
#include <tuple>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/known_rotation.h"

namespace heba {
namespace {

// Returns the sum of [x, skew(y)]^T [z, skew(w)], given the sums of x z^T, x w^T, y z^T and y w^T.
Eigen::Matrix4d SumOfProducts(const Eigen::Matrix3d& xz, const Eigen::Matrix3d& xw, const Eigen::Matrix3d& yz,
                              const Eigen::Matrix3d& yw) {
  Eigen::Matrix4d sum;
  sum(0, 0) = xz.trace();
  sum.topRightCorner<1, 3>() = SumOfCross(xw).transpose();
  sum.bottomLeftCorner<3, 1>() = -SumOfCross(yz);
  sum.bottomRightCorner<3, 3>() = yw.trace() * Eigen::Matrix3d::Identity() - yw.transpose();
  return sum;
}

}  // namespace

Outcome<HandEye> SolveHandEye_daniilidis(const HandEyeInput& input) {
  // The linear map from the screws a, a', b, b' to a - b, a + b, a' - b', a' + b'.
  using Matrix12 = Eigen::Matrix<double, 12, 12>;
  Matrix12 combine = Matrix12::Zero();
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  for (const auto& [row, a, b] :
       {std::tuple(0, MotionSums::kRealA, MotionSums::kRealB), std::tuple(6, MotionSums::kDualA, MotionSums::kDualB)}) {
    combine.block<3, 3>(row, a) = identity;
    combine.block<3, 3>(row, b) = -identity;
    combine.block<3, 3>(row + 3, a) = identity;
    combine.block<3, 3>(row + 3, b) = identity;
  }
  const Matrix12 combined = combine * input.motions().screws * combine.transpose();
  // Returns the sum of D^T E, where D and E are [a - b, skew(a + b)] or, for the dual part, [a' - b', skew(a' + b')].
  const auto sum_of = [&](int d, int e) {
    const auto block = [&](int i, int j) -> Eigen::Matrix3d { return combined.block<3, 3>(6 * d + i, 6 * e + j); };
    return SumOfProducts(block(0, 0), block(0, 3), block(3, 0), block(3, 3));
  };
  constexpr int kReal = 0;
  constexpr int kDual = 1;
  // S^T S, S = [D, 0; D', D].
  using Matrix8 = Eigen::Matrix<double, 8, 8>;
  Matrix8 sum;
  sum << sum_of(kReal, kReal) + sum_of(kDual, kDual), sum_of(kDual, kReal), sum_of(kReal, kDual), sum_of(kReal, kReal);
  const SymmetricEigen<8> eigen = EigenOfSymmetric(sum);
  const Eigen::Vector4d u1 = eigen.vectors.col(0).head<4>();
  const Eigen::Vector4d v1 = eigen.vectors.col(0).tail<4>();
  const Eigen::Vector4d u2 = eigen.vectors.col(1).head<4>();
  const Eigen::Vector4d v2 = eigen.vectors.col(1).tail<4>();
  // (q; q') = l1 (u1; v1) + l2 (u2; v2) with q q' = 0 is a quadratic equation in l1 / l2 or, if that is better
  // conditioned, in l2 / l1.
  double a = u1.dot(v1);
  const double b = u1.dot(v2) + u2.dot(v1);
  double c = u2.dot(v2);
  const bool swapped = std::abs(a) < std::abs(c);
  if (swapped) std::swap(a, c);
  if (std::abs(a) < 1e-300) return Failure{FailureCode("no_solution"), {}, {{"equations", "dual quaternion"}}};
  const double discriminant = std::max(0.0, b * b - 4 * a * c);
  // The root with the larger norm |q|^2 of the real part is used (equation (37)).
  double best_norm2 = 0;
  Eigen::Vector4d real = Eigen::Vector4d::Zero();
  Eigen::Vector4d dual = Eigen::Vector4d::Zero();
  for (const double sign : {-1.0, 1.0}) {
    const double ratio = (-b + sign * std::sqrt(discriminant)) / (2 * a);
    const double l1 = swapped ? 1.0 : ratio;
    const double l2 = swapped ? ratio : 1.0;
    const double scale = 1.0 / std::hypot(l1, l2);
    const Eigen::Vector4d q = scale * (l1 * u1 + l2 * u2);
    if (q.squaredNorm() > best_norm2) {
      best_norm2 = q.squaredNorm();
      real = q;
      dual = scale * (l1 * v1 + l2 * v2);
    }
  }
  if (!(best_norm2 > 1e-12)) return Failure{FailureCode("no_solution"), {}, {{"equations", "dual quaternion"}}};
  const double norm = std::sqrt(best_norm2);
  const Eigen::Quaterniond q(real[0] / norm, real[1] / norm, real[2] / norm, real[3] / norm);
  const Eigen::Quaterniond q_dual(dual[0] / norm, dual[1] / norm, dual[2] / norm, dual[3] / norm);
  const Eigen::Vector3d translation = 2.0 * (q_dual * q.conjugate()).vec();
  return WithAverageBoardPose(input.pairs(), {q, translation});
}

}  // namespace heba
