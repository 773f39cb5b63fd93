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
  const JointPrior& prior = *problem.prior;
  const PriorDifferences differences = DifferencesFrom(prior, solution.covariance.layout, ValuesOf(StateOf(solution)));
  // In units of the prior's sigmas.
  const Eigen::VectorXd sigmas = prior.covariance.matrix.diagonal().cwiseSqrt();
  const Eigen::VectorXd scales = sigmas.cwiseInverse();
  const Eigen::MatrixXd information =
      InverseOfSymmetric(Eigen::MatrixXd(scales.asDiagonal() * prior.covariance.matrix * scales.asDiagonal()));
  const Eigen::MatrixXd by_unknowns = information * scales.asDiagonal() * differences.by_unknowns;
  const Eigen::VectorXd gradient = information * scales.cwiseProduct(differences.values);
  const Eigen::MatrixXd of_gradient = information - by_unknowns * solution.covariance.matrix * by_unknowns.transpose();
  std::vector<PriorAgreement> all;
  for (const UnknownBlock& block : prior.covariance.layout.blocks()) {
    // The share of what the prior knew about the block that the captures tell, too.
    const Eigen::MatrixXd known = information.block(block.first, block.first, block.size, block.size);
    const Eigen::MatrixXd inverse_root = EigenOfSymmetric(known).InverseRoot();
    const auto eigen = EigenOfSymmetric(Eigen::MatrixXd(
        inverse_root * of_gradient.block(block.first, block.first, block.size, block.size) * inverse_root));
    const Eigen::VectorXd along = eigen.vectors.transpose() * inverse_root * gradient.segment(block.first, block.size);
    constexpr double kNothing = 1e-4;
    double statistic = 0;
    double num_directions = 0;
    for (Eigen::Index i = 0; i < block.size; ++i) {
      if (eigen.values[i] < kNothing) continue;
      statistic += along[i] * along[i] / eigen.values[i];
      ++num_directions;
    }
    PriorAgreement& agreement = all.emplace_back();
    agreement.block = block.name;
    agreement.is_of_poses = block.owner == UnknownOwner::kPose;
    if (num_directions == 0) continue;
    agreement.p_value = FisherTail(statistic / num_directions, num_directions, solution.covariance_dof);
    agreement.ratio = std::sqrt(statistic / num_directions);
  }
  return all;
}

}  // namespace heba
