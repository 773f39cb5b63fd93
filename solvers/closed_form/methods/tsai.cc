// R. Y. Tsai and R. K. Lenz, "A new technique for fully autonomous and efficient 3D robotics hand/eye calibration",
// IEEE Transactions on Robotics and Automation 5(3), 1989. Solves equation (12) over all motions, with P = 2
// sin(angle / 2) axis for each rotation,
//   skew(P_A + P_B) P' = P_B - P_A,   P' = tan(angle_X / 2) axis_X,
// and then equation (15) for the translation.
//
// P' diverges if X is a rotation by 180 deg, a common way to mount a camera. The equation is therefore solved four
// times, with the camera frame rotated by Q = identity and by 180 deg about x, y and z, and the solution whose X Q^-1
// has the smallest angle is used: for one of the four it is at most 120 deg.
#include <limits>

#include "heba/base/factorisation.h"
#include "heba/base/failure_code.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/known_rotation.h"

namespace heba {

Outcome<HandEye> SolveHandEye_tsai(const HandEyeInput& input) {
  const MotionSums& motions = input.motions();
  // P is twice the quaternion's vector part.
  const auto sum_of = [&](int x, int y) -> Eigen::Matrix3d { return 4 * motions.screws.block<3, 3>(x, y); };
  const Eigen::Matrix3d aa = sum_of(MotionSums::kRealA, MotionSums::kRealA);
  const Eigen::Matrix3d ab = sum_of(MotionSums::kRealA, MotionSums::kRealB);
  const Eigen::Matrix3d bb = sum_of(MotionSums::kRealB, MotionSums::kRealB);
  const Eigen::Quaterniond turns[] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  double smallest = std::numeric_limits<double>::infinity();
  Eigen::Quaterniond rotation_x = Eigen::Quaterniond::Identity();
  for (const Eigen::Quaterniond& turn : turns) {
    const Eigen::Matrix3d q = turn.toRotationMatrix();
    const Eigen::Matrix3d a_turned = ab * q.transpose();
    // For s = P_A + Q P_B: skew(s)^T skew(s) = |s|^2 I - s s^T, and skew(s)^T (Q P_B - P_A) = -2 P_A cross Q P_B.
    const Eigen::Matrix3d ss = aa + a_turned + a_turned.transpose() + q * bb * q.transpose();
    const Eigen::Matrix3d normal = ss.trace() * Eigen::Matrix3d::Identity() - ss;
    const Eigen::Vector3d p = SolveSymmetric(normal, -2 * SumOfCross(a_turned));
    if (!p.allFinite() || !(p.norm() < smallest)) continue;
    smallest = p.norm();
    rotation_x = Eigen::Quaterniond(1, p.x(), p.y(), p.z()).normalized() * turn;
  }
  if (!std::isfinite(smallest)) return Failure{FailureCode("no_solution"), {}, {{"equations", "rotation"}}};
  const Eigen::Matrix3d rotation = rotation_x.toRotationMatrix();
  return WithAverageBoardPose(input.pairs(), {rotation, SolveTranslation(motions, rotation)});
}

}  // namespace heba
