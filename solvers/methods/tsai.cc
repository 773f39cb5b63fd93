// R. Y. Tsai and R. K. Lenz, "A new technique for fully autonomous and efficient 3D robotics hand/eye calibration",
// IEEE Transactions on Robotics and Automation 5(3), 1989. With P = 2 sin(angle / 2) axis of a rotation, equation (12),
//   skew(P_A + P_B) P' = P_B - P_A,   P' = tan(angle_X / 2) axis_X,
// over all motions, then equation (15) for the translation.
//
// P' grows without bound when X is a rotation by half a turn, a common way to mount a camera. So the equation is solved
// with the camera's frame turned by Q = identity and half a turn about x, y, z, and the one whose X Q^-1 turns least is
// taken: one of the four turns by 120 deg at most.
#include <Eigen/Cholesky>

#include "solvers/relative_motion.h"

namespace heba {
namespace {

Eigen::Vector3d RodriguesVector(const Eigen::Quaterniond& rotation) {
  return (rotation.w() < 0 ? -2.0 : 2.0) * rotation.vec();
}

}  // namespace

Outcome<HandEye> SolveHandEye_tsai(const std::vector<PosePair>& pairs) {
  if (const std::optional<Failure> failure = CheckPairs(pairs)) return *failure;
  const Eigen::Quaterniond turns[] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  Eigen::Matrix3d normal[4];
  Eigen::Vector3d right[4];
  for (int k = 0; k < 4; ++k) {
    normal[k].setZero();
    right[k].setZero();
  }
  ForEachMotion(pairs, [&](const Rigid3d& a, const Rigid3d& b) {
    const Eigen::Vector3d p_a = RodriguesVector(a.rotation);
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d p_b = turns[k] * RodriguesVector(b.rotation);
      const Eigen::Matrix3d left = Skew(p_a + p_b);
      normal[k] += left.transpose() * left;
      right[k] += left.transpose() * (p_b - p_a);
    }
  });
  double smallest = std::numeric_limits<double>::infinity();
  Eigen::Quaterniond rotation_x = Eigen::Quaterniond::Identity();
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3d p = normal[k].ldlt().solve(right[k]);
    if (!p.allFinite() || !(p.norm() < smallest)) continue;
    smallest = p.norm();
    rotation_x = Eigen::Quaterniond(1, p.x(), p.y(), p.z()).normalized() * turns[k];
  }
  if (!std::isfinite(smallest)) return Failure{"the rotation equations have no solution"};
  const Eigen::Matrix3d rotation = rotation_x.toRotationMatrix();
  return WithMeanBoard(pairs, {rotation, SolveTranslation(pairs, rotation)});
}

}  // namespace heba
