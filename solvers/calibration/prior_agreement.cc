#include "solvers/calibration/prior_agreement.h"

#include <cmath>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/data/joint_prior.h"
#include "solvers/refine/fit.h"
#include "solvers/uncertainty/joint_prior_rows.h"

namespace heba {

std::vector<PriorAgreement> AgreementWithPrior(const Problem& problem, const Solution& solution) {
  CHECK(problem.prior != nullptr);
  const UnknownLayout& layout = solution.covariance.layout;
  const UnknownLayout& known = problem.prior->covariance.layout;
  const PriorDifferences differences = DifferencesFrom(*problem.prior, layout, ValuesOf(StateOf(solution)));
  std::vector<PriorAgreement> all;
  for (const UnknownBlock& block : known.blocks()) {
    const Eigen::MatrixXd prior =
        problem.prior->covariance.matrix.block(block.first, block.first, block.size, block.size);
    const Eigen::VectorXd scales = prior.diagonal().cwiseSqrt().cwiseInverse();
    const auto root = Cholesky(Eigen::MatrixXd(scales.asDiagonal() * prior * scales.asDiagonal()));
    CHECK(root) << "the covariance of a prior must be positive definite";
    // In the units of the prior's root, P is the identity.
    const auto lower = root->lower().triangularView<Eigen::Lower>();
    Eigen::MatrixXd by_unknowns = scales.asDiagonal() * differences.by_unknowns.middleRows(block.first, block.size);
    Eigen::VectorXd values = scales.cwiseProduct(differences.values.segment(block.first, block.size));
    lower.solveInPlace(by_unknowns);
    lower.solveInPlace(values);
    const auto eigen =
        EigenOfSymmetric(Eigen::MatrixXd(Eigen::MatrixXd::Identity(block.size, block.size) -
                                         by_unknowns * solution.covariance.matrix * by_unknowns.transpose()));
    constexpr double kNothing = 1e-3;  // Of the prior's variance.
    double statistic = 0;
    double num_directions = 0;
    for (Eigen::Index i = 0; i < block.size; ++i) {
      const double variance = eigen.values[i];
      if (variance < kNothing) continue;
      const double along = eigen.vectors.col(i).dot(values);
      statistic += along * along / variance;
      ++num_directions;
    }
    PriorAgreement& agreement = all.emplace_back();
    agreement.block = block.name;
    if (num_directions == 0) continue;
    agreement.p_value = FisherTail(statistic / num_directions, num_directions, solution.covariance_dof);
    agreement.ratio = std::sqrt(statistic / num_directions);
  }
  return all;
}

}  // namespace heba
