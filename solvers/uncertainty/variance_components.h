// Estimation of variances from the residuals: of the pixels, of effects that each capture draws anew (the robot's
// corrections), and of effects that captures share (the offsets of an arm's joints). Equation (11) of
// docs/estimation.md.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "solvers/uncertainty/linearisation.h"
#include "solvers/uncertainty/variance_groups.h"

namespace heba {

// Estimated variances, in the order of their groups.
struct VarianceComponents {
  Eigen::VectorXd variances;
  // Their standard deviations from the curvature of the likelihood; 0 if not free.
  Eigen::VectorXd stddev;
  // Their covariance; rows and columns of a variance that is not free or cannot be told from zero are 0.
  Eigen::MatrixXd covariance;
};

// Values for `small_change`.
constexpr double kExactVariances = 1e-4;
constexpr double kRoughVariances = 1e-2;
// Estimates the variances of the linearised captures by restricted maximum likelihood (Patterson and Thompson 1971)
// with Fisher scoring and, near the maximum, Newton's method. The first group must be that of the pixels, and a column
// belongs to at most one group; effects without a group are zero. No variance can become negative, and each becomes
// zero if the data require it, unless it has a prior. Iteration ends with the first step that changes no variance by
// more than `small_change` of its own standard deviation. With priors, the estimate is the mode of likelihood times
// prior.
VarianceComponents EstimateVariances(const std::vector<LinearisedView>& views, const std::vector<VarianceGroup>& groups,
                                     double small_change = kExactVariances);

// A start states whether the variances of the groups are near their estimates, which then cost less, or anywhere.
enum class VarianceStart { kAnywhere, kNear };
// Sets the variances of the groups to their estimates, found with kRoughVariances. Returns the logarithm of restricted
// likelihood times prior, as RestrictedLogLikelihood with a unit of 1 and all unknowns common, to some 1e-4.
double FitVariances(const std::vector<LinearisedView>& views, VarianceStart start, std::vector<VarianceGroup>* groups);

// Returns the restricted log-likelihood of the views' measurements in px at the groups' variances, up to a constant
// that all models of the same rows share: the log-density of the contrasts that the first `num_common` unknowns leave
// open. `unit_px` is the views' unit, px. The remaining unknowns count as fixed at the linearisation point, so that
// models that differ in them can be compared (Welham and Thompson, "Likelihood ratio tests for fixed model terms using
// residual maximum likelihood", 1997, section 2.2). The log-densities of the groups' priors are added. Returns minus
// infinity if the variances make a covariance singular.
double RestrictedLogLikelihood(const std::vector<LinearisedView>& views, double unit_px,
                               const std::vector<VarianceGroup>& groups, Eigen::Index num_common);

// The restricted log-likelihood, up to a constant, and its derivatives by the variances: the scores of Fisher scoring.
struct LikelihoodScores {
  double log_likelihood = 0;
  Eigen::VectorXd scores;
  Eigen::MatrixXd fisher;  // The expected information about the variances.
};
// Returns nothing if the variances make a covariance singular.
std::optional<LikelihoodScores> ScoresOf(const std::vector<LinearisedView>& views,
                                         const std::vector<VarianceGroup>& groups);

// Returns the degrees of freedom of the unknowns' covariance as a whole, given the uncertainty
// VarianceComponents::covariance of the variances: Satterthwaite's for each direction, combined as by Fai and
// Cornelius (1996). Infinite if the variances are certain, at least 4.
double DegreesOfFreedom(const std::vector<LinearisedView>& views, const std::vector<VarianceGroup>& groups,
                        const VarianceComponents& variances);

}  // namespace heba
