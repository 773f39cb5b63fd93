// The variances of pixels and robot that explain the residuals best.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "solvers/uncertainty/robot_noise.h"

namespace heba {

// The knowledge of a robot's noise before the first capture: log-normal densities of its two sigmas.
struct RobotNoisePrior {
  RobotNoise median;
  double log_sigma = 1;  // One sigma of the logarithm of either sigma.
};
// Industrial arms: 95 % of the sigmas lie between 0.05 and 1 mm and between 0.005 and 0.1 deg.
RobotNoisePrior IndustrialArmPrior();

// Restricted maximum likelihood (Patterson and Thompson 1971) of the three variances given the linearised views, by
// Fisher scoring; none can become negative, and each becomes zero if the data ask for it. Those not free stay. It ends
// with the first step that changes none of them by more than `small_change` of its own uncertainty. With a prior of the
// robot's noise the estimate is the mode of likelihood times prior, and neither of the robot's variances is zero.
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
VarianceComponents EstimateVariances(const std::vector<LinearisedView>& views, const VarianceComponents& start,
                                     bool pixel_is_free, bool robot_is_free, double small_change = kExactVariances,
                                     const RobotNoisePrior* prior = nullptr);

// The restricted log-likelihood of the views' measurements in px, one of the views' unit being `unit_px`, up to a
// constant that all models of the same rows share: the density of the contrasts that the first `num_common` unknowns
// leave open. The unknowns after these count as fixed where the views were linearised, so that models with different
// unknowns there can be compared (Welham and Thompson, "Likelihood ratio tests for fixed model terms using residual
// maximum likelihood", 1997, section 2.2). With a prior its log-density is added. Minus infinity where the variances
// make a covariance singular.
double RestrictedLogLikelihood(const std::vector<LinearisedView>& views, double unit_px,
                               const VarianceComponents& variances, Eigen::Index num_common,
                               const RobotNoisePrior* prior = nullptr);

// The degrees of freedom that variances known to VarianceComponents::covariance leave the unknowns' covariance as a
// whole (Satterthwaite's, direction by direction, put together as by Fai and Cornelius 1996): infinite if the variances
// are certain, at least 4.
double DegreesOfFreedom(const std::vector<LinearisedView>& views, const VarianceComponents& variances);

}  // namespace heba
