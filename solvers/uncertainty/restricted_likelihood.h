// The restricted likelihood of linearised captures as a function of variances. Equation (11) of docs/estimation.md.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "solvers/uncertainty/linearisation.h"
#include "solvers/uncertainty/variance_groups.h"

namespace heba {

// The restricted likelihood and its derivatives with respect to the variances.
struct Likelihood {
  double minus_log = std::numeric_limits<double>::infinity();
  Eigen::VectorXd gradient;  // Gradient of the log-likelihood.
  // The average of the expected and the observed information (Gilmour, Thompson and Cullis, "Average information REML",
  // 1995): half the product of V_k P y and P V_l P y for variances k and l.
  Eigen::MatrixXd average;
  Eigen::MatrixXd fisher;  // The expected information; empty unless it was asked for.
};

// The expected information costs several times as much as the rest.
enum class Curvature { kAverage, kAverageAndExpected };

// The information about the unknowns, and its negated derivatives by the variances.
struct InformationAndDerivatives {
  Eigen::MatrixXd information;
  std::vector<Eigen::MatrixXd> derivatives;
};

class RestrictedLikelihood {
 public:
  virtual ~RestrictedLikelihood() = default;
  // If the variances make a covariance singular, or the captures do not determine the unknowns, minus_log is infinite,
  // and the rest is zero.
  virtual Likelihood At(const Eigen::VectorXd& variances, Curvature curvature) const = 0;
  // Returns nothing if the variances make a covariance singular. Unknowns whose variance is zero are left out.
  virtual std::optional<InformationAndDerivatives> InformationAt(const Eigen::VectorXd& variances) const = 0;
};

// Returns the likelihood of the captures, which must be at least one; the first group must be that of the pixels.
std::unique_ptr<RestrictedLikelihood> MakeLikelihood(const std::vector<LinearisedView>& views,
                                                     const std::vector<VarianceGroup>& groups);

}  // namespace heba
