#include "solvers/calibration/prior_agreement.h"

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "solvers/refine/fit.h"
#include "solvers/uncertainty/joint_prior_rows.h"

namespace heba {

double PriorPValue(const Problem& problem, const Solution& solution) {
  CHECK(problem.prior != nullptr);
  const JointPriorRows rows = RowsOf(*problem.prior, solution.covariance.layout, ValuesOf(StateOf(solution)));
  const Eigen::Index size = rows.residuals.size();
  // In the units of the prior's root, P is the identity.
  const auto eigen = EigenOfSymmetric(
      Eigen::MatrixXd(Eigen::MatrixXd::Identity(size, size) -
                      rows.by_unknowns * solution.covariance.matrix * rows.by_unknowns.transpose()));
  constexpr double kNothing = 1e-3;  // Of the prior's variance.
  double statistic = 0;
  double num_directions = 0;
  for (Eigen::Index i = 0; i < size; ++i) {
    const double variance = eigen.values[i];
    if (variance < kNothing) continue;
    const double along = eigen.vectors.col(i).dot(rows.residuals);
    statistic += along * along / variance;
    ++num_directions;
  }
  if (num_directions == 0) return 1;
  return FisherTail(statistic / num_directions, num_directions, solution.covariance_dof);
}

}  // namespace heba
