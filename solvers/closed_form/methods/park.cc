// F. C. Park and B. J. Martin, "Robot sensor calibration: solving AX = XB on the Euclidean group", IEEE Transactions
// on Robotics and Automation 10(5), 1994. With alpha = log R_A and beta = log R_B, the rotation minimises the sum of
// |R_X beta - alpha|^2: R_X = (M^T M)^(-1/2) M^T, M = sum beta alpha^T, computed by SVD. The translation follows by
// linear least squares.
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/closed_form/known_rotation.h"

namespace heba {

Outcome<HandEye> SolveHandEye_park(const HandEyeInput& input) {
  const MotionSums& motions = input.motions();
  const Eigen::Matrix3d m = motions.axes.block<3, 3>(MotionSums::kVectorA, MotionSums::kVectorB);
  const Eigen::Matrix3d rotation = NearestRotation(m);
  return WithAverageBoardPose(input.pairs(), {rotation, SolveTranslation(motions, rotation)});
}

}  // namespace heba
