// F. C. Park and B. J. Martin, "Robot sensor calibration: solving AX = XB on the Euclidean group", IEEE Transactions on
// Robotics and Automation 10(5), 1994. With alpha = log R_A and beta = log R_B the rotation minimises the sum of
// |R_X beta - alpha|^2: R_X = (M^T M)^(-1/2) M^T, M = sum beta alpha^T, computed by SVD; then the translation.
#include "solvers/relative_motion.h"

namespace heba {

Outcome<HandEye> SolveHandEye_park(const std::vector<PosePair>& pairs) {
  if (const std::optional<Failure> failure = CheckPairs(pairs)) return *failure;
  Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
  ForEachMotion(pairs, [&](const Rigid3d& a, const Rigid3d& b) {
    m += LogRotation(b.rotation) * LogRotation(a.rotation).transpose();
  });
  const Eigen::Matrix3d rotation = NearestRotation(m.transpose());
  return WithMeanBoard(pairs, {rotation, SolveTranslation(pairs, rotation)});
}

}  // namespace heba
