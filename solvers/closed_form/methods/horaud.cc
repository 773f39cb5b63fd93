// R. Horaud and F. Dornaika, "Hand-eye calibration", International Journal of Robotics Research 14(3), 1995. The
// rotation axes of a motion satisfy n_A = R_X n_B. With unit quaternions, n_A q - q n_B = 0 is linear in q, and the
// unit q that minimises the sum of squares is the eigenvector of the smallest eigenvalue (section 4.1). The
// translation follows by linear least squares.
#include "heba/base/factorisation.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/known_rotation.h"

namespace heba {

Outcome<HandEye> SolveHandEye_horaud(const HandEyeInput& input) {
  const MotionSums& motions = input.motions();
  const auto sum_of = [&](int x, int y) -> Eigen::Matrix3d { return motions.axes.block<3, 3>(x, y); };
  const Eigen::Matrix3d aa = sum_of(MotionSums::kAxisA, MotionSums::kAxisA);
  const Eigen::Matrix3d ab = sum_of(MotionSums::kAxisA, MotionSums::kAxisB);
  const Eigen::Matrix3d bb = sum_of(MotionSums::kAxisB, MotionSums::kAxisB);
  const Eigen::Matrix3d both = ab + ab.transpose();
  // Sums of the outer products of the difference d = n_A - n_B and of the sum s = n_A + n_B.
  const Eigen::Matrix3d dd = aa - both + bb;
  const Eigen::Matrix3d ss = aa + both + bb;
  // The sum of D^T D, D = [0, -d^T; d, skew(s)]; rows and columns in the order w, x, y, z.
  Eigen::Matrix4d sum;
  sum(0, 0) = dd.trace();
  sum.bottomLeftCorner<3, 1>() = 2 * SumOfCross(ab);  // d cross s
  sum.topRightCorner<1, 3>() = sum.bottomLeftCorner<3, 1>().transpose();
  sum.bottomRightCorner<3, 3>() = dd + ss.trace() * Eigen::Matrix3d::Identity() - ss;
  const Eigen::Vector4d q = EigenOfSymmetric(sum).vectors.col(0);
  const Eigen::Matrix3d rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  return WithAverageBoardPose(input.pairs(), {rotation, SolveTranslation(motions, rotation)});
}

}  // namespace heba
