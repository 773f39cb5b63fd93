// The variances of pixels and robot that explain the residuals best.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "solvers/robot_noise.h"

namespace heba {

// Restricted maximum likelihood (Patterson and Thompson 1971) of the three variances given the linearised views, by
// Fisher scoring; none can become negative, and each becomes zero if the data ask for it. Those not free stay. It ends
// with the first step that changes none of them by more than `small_change` of its own uncertainty.
struct VarianceComponents {
  double pixel = 1;  // Of the views' unit.
  double translation_m2 = 0;
  double rotation_rad2 = 0;
  // Of pixel, translation, rotation: one sigma, as the likelihood's curvature tells it; 0 of those that are not free.
  Eigen::Vector3d stddev = Eigen::Vector3d::Zero();
  // Their covariance, likewise.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};
constexpr double kExactVariances = 1e-4;
constexpr double kRoughVariances = 1e-2;
VarianceComponents EstimateVariances(const std::vector<LinearView>& views, const VarianceComponents& start,
                                     bool pixel_is_free, bool robot_is_free, double small_change = kExactVariances);

// The degrees of freedom that variances known to VarianceComponents::covariance leave the unknowns' covariance as a
// whole (Satterthwaite's, direction by direction, put together as by Fai and Cornelius 1996): infinite if the variances
// are certain, at least 4.
double DegreesOfFreedom(const std::vector<LinearView>& views, const VarianceComponents& variances);

}  // namespace heba
