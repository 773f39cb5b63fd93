// The difference between two estimates of one pose, in relation to their uncertainties.
#pragma once

#include <limits>
#include <optional>

#include <Eigen/Core>

#include "heba/geometry/rigid3.h"

namespace heba {

// An estimate of a pose.
struct UncertainPose {
  Rigid3d pose;
  // The covariance of the tangent on the right: translation (m), then rotation (rad), in the child frame.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double covariance_dof = std::numeric_limits<double>::infinity();  // PairSolution::covariance_dof.
};

struct PoseDifference {
  double distance_mm = 0;
  double angle_deg = 0;
  // One sigma of distance and angle, from the sum of both covariances.
  double sigma_mm = 0;
  double sigma_deg = 0;
  // The probability of a difference at least as large between two estimates of the same pose: Hotelling's test of all
  // six coordinates with the sum of the two covariances. It assumes that the estimates share no captures and uses the
  // smaller number of degrees of freedom of the two.
  double p_value = 1;
};

// Returns nothing if a coordinate has no variance.
std::optional<PoseDifference> DifferenceOf(const UncertainPose& a, const UncertainPose& b);

}  // namespace heba
