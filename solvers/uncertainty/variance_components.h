// Estimation of the variances of pixels and robot from the residuals: equation (11) of docs/estimation.md.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "solvers/uncertainty/robot_noise.h"

namespace heba {

// Prior knowledge of a robot's noise: log-normal densities of its two sigmas.
struct RobotNoisePrior {
  RobotNoise median;
  double log_sigma = 1;  // Standard deviation of the logarithm of either sigma.
};
// Returns the prior for industrial arms: 95 % of the sigmas lie between 0.05 and 1 mm and between 0.005 and 0.1 deg.
RobotNoisePrior IndustrialArmPrior();

// The variances of pixel noise and robot noise, with their uncertainty.
struct VarianceComponents {
  double pixel = 1;  // Relative to the views' unit.
  double translation_m2 = 0;
  double rotation_rad2 = 0;
  // Standard deviations of pixel, translation and rotation variance from the curvature of the likelihood; 0 if not
  // free.
  Eigen::Vector3d stddev = Eigen::Vector3d::Zero();
  // Their covariance; rows and columns of a variance that is not free or cannot be told from zero are 0.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};
// Values for `small_change`.
constexpr double kExactVariances = 1e-4;
constexpr double kRoughVariances = 1e-2;
// Estimates the three variances of the linearised views by restricted maximum likelihood (Patterson and Thompson 1971)
// with Fisher scoring. No variance can become negative, and each becomes zero if the data require it. Variances that
// are not free keep their start values. Iteration ends with the first step that changes no variance by more than
// `small_change` of its own standard deviation. With a prior of the robot noise, the estimate is the mode of likelihood
// times prior, and neither of the robot's variances becomes zero.
VarianceComponents EstimateVariances(const std::vector<LinearisedView>& views, const VarianceComponents& start,
                                     bool pixel_is_free, bool robot_is_free, double small_change = kExactVariances,
                                     const RobotNoisePrior* prior = nullptr);

// Returns the restricted log-likelihood of the views' measurements in px, up to a constant that all models of the
// same rows share: the log-density of the contrasts that the first `num_common` unknowns leave open. `unit_px` is the
// views' unit, px. The remaining unknowns count as fixed at the linearisation point, so that models that differ in
// them can be compared (Welham and Thompson, "Likelihood ratio tests for fixed model terms using residual maximum
// likelihood", 1997, section 2.2). With a prior its log-density is added. Returns minus infinity if the variances
// make a covariance singular.
double RestrictedLogLikelihood(const std::vector<LinearisedView>& views, double unit_px,
                               const VarianceComponents& variances, Eigen::Index num_common,
                               const RobotNoisePrior* prior = nullptr);

// Returns the degrees of freedom of the unknowns' covariance as a whole, given the uncertainty
// VarianceComponents::covariance of the variances: Satterthwaite's for each direction, combined as by Fai and
// Cornelius (1996). Infinite if the variances are certain, at least 4.
double DegreesOfFreedom(const std::vector<LinearisedView>& views, const VarianceComponents& variances);

}  // namespace heba
