#include "heba/evaluation/pose_difference.h"

#include <algorithm>
#include <cmath>

#include "heba/base/distributions.h"
#include "heba/base/factorisation.h"
#include "heba/base/units.h"
#include "heba/kernels/small_matrix.h"

namespace heba {

std::optional<PoseDifference> DifferenceOf(const UncertainPose& a, const UncertainPose& b) {
  const Matrix6 covariance = a.covariance + b.covariance;
  const Tangent6 difference = LocalCoordinates(a.pose, b.pose);
  const Tangent6 scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return std::nullopt;
  const Matrix6 scaled = scale.asDiagonal() * covariance * scale.asDiagonal();
  const Tangent6 scaled_difference = scale.cwiseProduct(difference);
  const double statistic = MahalanobisSquare(scaled_difference, scaled);
  PoseDifference found;
  found.distance_mm = 1000 * DistanceM(a.pose, b.pose);
  found.angle_deg = RadToDeg(AngleRad(a.pose, b.pose));
  found.sigma_mm = 1000 * std::sqrt(covariance.diagonal().head<3>().sum());
  found.sigma_deg = RadToDeg(std::sqrt(covariance.diagonal().tail<3>().sum()));
  found.p_value = FisherTail(statistic / 6, 6, std::min(a.covariance_dof, b.covariance_dof));
  return found;
}

}  // namespace heba
