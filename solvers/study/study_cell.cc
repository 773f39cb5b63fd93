#include "solvers/study/study_cell.h"

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"

namespace heba {

bool IsHandEye(const StudyCell& cell) { return cell.problem.cameras.at(0).name.empty(); }

Setup SetupOf(const StudyCell& cell) { return SetupOf(cell.problem.cameras[0].mount); }

HandEye HandEyeOf(const StudyCell& cell) { return {cell.poses.mount_from_camera[0], cell.poses.mount_from_target[0]}; }

bool IsCovered(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance, double dof) {
  constexpr double kOutside = 0.05;
  const auto size = static_cast<double>(error.size());
  // The unknowns have different units, whose covariances are badly scaled.
  const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
  const double squares =
      MahalanobisSquare(scale.cwiseProduct(error), scale.asDiagonal() * covariance * scale.asDiagonal());
  return squares <= size * FisherQuantile(kOutside, size, dof);
}

}  // namespace heba
