// R. Horaud and F. Dornaika, "Hand-eye calibration", International Journal of Robotics Research 14(3), 1995. The axes
// of a motion obey n_A = R_X n_B; with unit quaternions, n_A q - q n_B = 0 is linear in q, and the unit q that
// minimises the sum of squares is the eigenvector of the smallest eigenvalue (section 4.1); then the translation.
#include <Eigen/Eigenvalues>

#include "solvers/relative_motion.h"

namespace heba {

Outcome<HandEye> SolveHandEye_horaud(const std::vector<PosePair>& pairs) {
  if (const std::optional<Failure> failure = CheckPairs(pairs)) return *failure;
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  ForEachMotion(pairs, [&](const Rigid3d& a, const Rigid3d& b) {
    const Eigen::Vector3d n_a = LogRotation(a.rotation).normalized();
    const Eigen::Vector3d n_b = LogRotation(b.rotation).normalized();
    // Rows and columns in the order w, x, y, z.
    Eigen::Matrix4d difference;
    difference(0, 0) = 0;
    difference.topRightCorner<1, 3>() = -(n_a - n_b).transpose();
    difference.bottomLeftCorner<3, 1>() = n_a - n_b;
    difference.bottomRightCorner<3, 3>() = Skew(n_a + n_b);
    sum += difference.transpose() * difference;
  });
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(sum);
  const Eigen::Vector4d q = eigen.eigenvectors().col(0);
  const Eigen::Matrix3d rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  return WithMeanBoard(pairs, {rotation, SolveTranslation(pairs, rotation)});
}

}  // namespace heba
