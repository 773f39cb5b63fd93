#include "solvers/calibration/unseen_errors.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "heba/base/factorisation.h"
#include "solvers/refine/fit.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// The products of the whitened rows of all captures: by the unknowns, by the errors, and with the offsets.
struct Products {
  Eigen::MatrixXd all;
  Eigen::Index num_unknowns = 0;
  Eigen::Index num_errors = 0;
  Eigen::Index num_rows = 0;

  Eigen::MatrixXd Block(Eigen::Index row, Eigen::Index column, Eigen::Index rows, Eigen::Index columns) const {
    return all.block(row, column, rows, columns);
  }
};

Products ProductsOf(const std::vector<LinearisedView>& views, Eigen::Index first_column,
                    const Eigen::VectorXd& variances, const StandInErrors& errors, Eigen::Index num_unknowns) {
  Products products;
  products.num_unknowns = num_unknowns;
  products.num_errors = errors.sigmas.size();
  products.all = Eigen::MatrixXd::Zero(num_unknowns + products.num_errors + 1, num_unknowns + products.num_errors + 1);
  for (size_t g = 0; g < errors.gripper_by_errors.size(); ++g) {
    LinearisedView view = views[g];
    view.by_unknowns.conservativeResize(Eigen::NoChange, num_unknowns + products.num_errors);
    view.by_unknowns.rightCols(products.num_errors) =
        view.by_effects.middleCols<6>(first_column) * errors.gripper_by_errors[g];
    const RowMajorMatrix rows = WhitenedRows(view, 1, variances);
    products.all += rows.transpose() * rows;
    products.num_rows += rows.rows();
  }
  return products;
}

// Returns the amplitude of the errors that the captures show.
double AmplitudeOf(const Products& products, const std::vector<Eigen::Index>& unknowns, const Eigen::VectorXd& sigmas) {
  const Eigen::Index first_error = products.num_unknowns;
  const Eigen::Index last = products.all.cols() - 1;
  std::vector<Eigen::Index> rest;
  for (Eigen::Index i = first_error; i <= last; ++i) rest.push_back(i);
  const Eigen::MatrixXd information = products.all(unknowns, unknowns);
  const Eigen::MatrixXd coupling = products.all(unknowns, rest);
  const auto factor = Cholesky(information);
  if (!factor) return 0;
  const Eigen::MatrixXd solved = factor->SolveLower(coupling);
  const Eigen::MatrixXd reduced = products.all(rest, rest) - solved.transpose() * solved;
  const double excess = reduced(products.num_errors, products.num_errors) -
                        static_cast<double>(products.num_rows - static_cast<Eigen::Index>(unknowns.size()));
  const double expected = reduced.diagonal().head(products.num_errors).dot(sigmas.cwiseAbs2());
  return excess > 0 && expected > 0 ? std::min(kMostAmplitude, std::sqrt(excess / expected)) : 0;
}

}  // namespace

std::vector<Eigen::VectorXd> ChangesByUnseenErrors(const Problem& problem, const Solution& solution, size_t robot,
                                                   const StandInErrors& errors) {
  const SharedEffects* const smooth = EffectsOf(problem, robot);
  if (smooth == nullptr || smooth->kind != SharedEffectsKind::kSmooth) return {};
  const Problem weighted = WeightedAs(solution, problem);
  const std::vector<size_t> moving = MovingRobots(weighted);
  const FitNoise noise = NoiseOf(solution);
  const CaptureGroups groups = GroupByRobotPoses(weighted);
  if (noise.robots.empty() || groups.size() != errors.gripper_by_errors.size()) return {};
  const std::optional<std::vector<LinearisedView>> views =
      LineariseFit(weighted, groups, StateOf(solution), noise, LossOf(LossKind::kNone), 1);
  if (!views) return {};
  const Eigen::Index first_column = 6 * (std::find(moving.begin(), moving.end(), robot) - moving.begin());
  const Eigen::VectorXd variances = CorrectionVariances(noise, NoisyJointsOf(weighted, moving));
  const Covariance& covariance = solution.covariance;
  const Eigen::Index n = covariance.layout.size();
  const Products products = ProductsOf(*views, first_column, variances, errors, n);

  const UnknownBlock effects = covariance.layout.Block(ErrorsBlock(weighted.robots[robot]));
  std::vector<Eigen::Index> others;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (i < effects.first || i >= effects.end()) others.push_back(i);
  }
  const double amplitude = AmplitudeOf(products, others, errors.sigmas);
  if (amplitude <= 0) return {};
  const Eigen::MatrixXd by_errors =
      amplitude * covariance.matrix * products.Block(0, n, n, products.num_errors) * errors.sigmas.asDiagonal();
  Eigen::MatrixXd more = by_errors(others, Eigen::all) * by_errors(others, Eigen::all).transpose();
  for (Eigen::Index k = 0; k < effects.size; ++k) {
    const double sigma = solution.effect_sigmas[robot][smooth->effects[static_cast<size_t>(k)].group];
    const Eigen::VectorXd by_smooth = covariance.matrix(others, effects.first + k) / sigma;
    more -= by_smooth * by_smooth.transpose();
  }
  // The part that increases C, in its metric.
  const Eigen::MatrixXd own = covariance.matrix(others, others);
  const auto root = Cholesky(own);
  if (!root) return {};
  const Eigen::MatrixXd left = root->SolveLower(more);
  const Eigen::MatrixXd relative = root->SolveLower(Eigen::MatrixXd(left.transpose()));
  const auto eigen = EigenOfSymmetric(Eigen::MatrixXd(0.5 * (relative + relative.transpose())));
  std::vector<Eigen::VectorXd> changes;
  for (Eigen::Index k = 0; k < eigen.values.size(); ++k) {
    if (eigen.values[k] <= 0) continue;
    const Eigen::VectorXd column =
        root->lower().triangularView<Eigen::Lower>() * (std::sqrt(eigen.values[k]) * eigen.vectors.col(k));
    Eigen::VectorXd& change = changes.emplace_back(Eigen::VectorXd::Zero(n));
    change(others) = column;
  }
  return changes;
}

}  // namespace heba
