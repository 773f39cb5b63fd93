// K. Daniilidis, "Hand-eye calibration using dual quaternions", International Journal of Robotics Research 18(3), 1999.
// A motion's screw, a + epsilon a' seen by the robot and b + epsilon b' by the camera (vector parts of the dual
// quaternions), gives six equations in the dual quaternion q + epsilon q' of X, equation (31):
//   [a - b, skew(a + b), 0, 0; a' - b', skew(a' + b'), a - b, skew(a + b)] [q; q'] = 0.
// The solution lies in the span of the two right singular vectors of the smallest singular values; q q = 1 and
// q q' = 0 fix it (equations (34) to (37)).
#include <cmath>

#include <Eigen/Eigenvalues>

#include "solvers/relative_motion.h"

namespace heba {
namespace {

struct DualVector {
  Eigen::Vector3d real;
  Eigen::Vector3d dual;
};

// The vector parts of the dual quaternion of a motion, with a real scalar part that is not negative. q' = t q / 2.
DualVector ScrewOf(const Rigid3d& motion) {
  const double sign = motion.rotation.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * motion.rotation.vec();
  const double w = sign * motion.rotation.w();
  const Eigen::Vector3d& t = motion.translation;
  return {v, 0.5 * (w * t + t.cross(v))};
}

}  // namespace

Outcome<HandEye> SolveHandEye_daniilidis(const std::vector<PosePair>& pairs) {
  if (const std::optional<Failure> failure = CheckPairs(pairs)) return *failure;
  using Matrix8 = Eigen::Matrix<double, 8, 8>;
  Matrix8 sum = Matrix8::Zero();
  ForEachMotion(pairs, [&](const Rigid3d& motion_a, const Rigid3d& motion_b) {
    const DualVector a = ScrewOf(motion_a);
    const DualVector b = ScrewOf(motion_b);
    Eigen::Matrix<double, 6, 8> s = Eigen::Matrix<double, 6, 8>::Zero();
    s.block<3, 1>(0, 0) = a.real - b.real;
    s.block<3, 3>(0, 1) = Skew(a.real + b.real);
    s.block<3, 1>(3, 0) = a.dual - b.dual;
    s.block<3, 3>(3, 1) = Skew(a.dual + b.dual);
    s.block<3, 1>(3, 4) = a.real - b.real;
    s.block<3, 3>(3, 5) = Skew(a.real + b.real);
    sum += s.transpose() * s;
  });
  const Eigen::SelfAdjointEigenSolver<Matrix8> eigen(sum);
  const Eigen::Vector4d u1 = eigen.eigenvectors().col(0).head<4>();
  const Eigen::Vector4d v1 = eigen.eigenvectors().col(0).tail<4>();
  const Eigen::Vector4d u2 = eigen.eigenvectors().col(1).head<4>();
  const Eigen::Vector4d v2 = eigen.eigenvectors().col(1).tail<4>();
  // (q; q') = l1 (u1; v1) + l2 (u2; v2) with q q' = 0: a quadratic in l1 / l2 or, where that is better conditioned, in
  // l2 / l1.
  double a = u1.dot(v1);
  const double b = u1.dot(v2) + u2.dot(v1);
  double c = u2.dot(v2);
  const bool swapped = std::abs(a) < std::abs(c);
  if (swapped) std::swap(a, c);
  if (std::abs(a) < 1e-300) return Failure{"the dual quaternion equations have no solution"};
  const double discriminant = std::max(0.0, b * b - 4 * a * c);
  // Of the two roots the one with the larger real part |q|^2 (equation (37)).
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
  if (!(best_norm2 > 1e-12)) return Failure{"the dual quaternion equations have no solution"};
  const double norm = std::sqrt(best_norm2);
  const Eigen::Quaterniond q(real[0] / norm, real[1] / norm, real[2] / norm, real[3] / norm);
  const Eigen::Quaterniond q_dual(dual[0] / norm, dual[1] / norm, dual[2] / norm, dual[3] / norm);
  const Eigen::Vector3d translation = 2.0 * (q_dual * q.conjugate()).vec();
  return WithMeanBoard(pairs, {q, translation});
}

}  // namespace heba
