#include "solvers/uncertainty/variance_components.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "solvers/uncertainty/restricted_likelihood.h"

namespace heba {
namespace {

using Kind = VarianceGroup::Kind;

// Adds the densities of the square roots of the variances, the log-normal ones expressed in the logarithm of the
// variance.
void AddPriors(const std::vector<VarianceGroup>& groups, const Eigen::VectorXd& variances, Likelihood* likelihood) {
  for (size_t i = 0; i < groups.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const double v = variances[k];
    const double square = groups[i].half_cauchy * groups[i].half_cauchy;
    likelihood->minus_log += std::log1p(v / square);
    likelihood->gradient[k] -= 1 / (v + square);
    if (likelihood->fisher.size() > 0) likelihood->average(k, k) -= 0.5 / std::pow(v + square, 2);
    if (!groups[i].prior && !groups[i].avoids_zero) continue;
    if (!(v > 0)) {
      likelihood->minus_log = std::numeric_limits<double>::infinity();
      return;
    }
    double information = 0;
    double lack = 0;  // The observed information is less than `information` by this.
    if (groups[i].avoids_zero) {
      likelihood->minus_log -= 0.5 * std::log(v);
      likelihood->gradient[k] += 0.5 / v;
      information += 0.5 / (v * v);
    }
    if (groups[i].prior) {
      const double log_variance_sigma = 2 * groups[i].prior->log_sigma;
      const double distance = (std::log(v) - 2 * std::log(groups[i].prior->median)) / log_variance_sigma;
      likelihood->minus_log += 0.5 * distance * distance;
      likelihood->gradient[k] -= distance / (log_variance_sigma * v);
      information += 1 / std::pow(log_variance_sigma * v, 2);
      lack = distance / (log_variance_sigma * v * v);
    }
    likelihood->average(k, k) += information;
    if (likelihood->fisher.size() == 0) continue;
    // Newton's method takes the observed information from both, and scoring the expected one alone.
    likelihood->average(k, k) -= 0.5 * lack;
    likelihood->fisher(k, k) += information;
  }
}

// Returns a likelihood at these variances times the priors.
Likelihood WithPriors(const std::vector<VarianceGroup>& groups, const Eigen::VectorXd& variances,
                      Likelihood likelihood) {
  AddPriors(groups, variances, &likelihood);
  return likelihood;
}

Eigen::VectorXd VariancesOf(const std::vector<VarianceGroup>& groups) {
  Eigen::VectorXd variances(static_cast<Eigen::Index>(groups.size()));
  for (size_t k = 0; k < groups.size(); ++k) variances[static_cast<Eigen::Index>(k)] = groups[k].variance;
  return variances;
}

// Returns the step of Fisher scoring for the variances `free`, with the expected information or, where it is not known,
// the average one.
Eigen::VectorXd ScoringStep(const Likelihood& here, const std::vector<Eigen::Index>& free) {
  const Eigen::MatrixXd fisher = (here.fisher.size() > 0 ? here.fisher : here.average)(free, free);
  const Eigen::VectorXd gradient = here.gradient(free);
  const Eigen::VectorXd scale = fisher.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
  const Eigen::MatrixXd scaled = scale.asDiagonal() * fisher * scale.asDiagonal();
  const auto size = static_cast<Eigen::Index>(free.size());
  return scale.asDiagonal() *
         SolveSymmetric(scaled + 1e-9 * Eigen::MatrixXd::Identity(size, size), scale.cwiseProduct(gradient));
}

// Returns the step of Newton's method for the variances `free`. The observed information is as much below the average
// one as that is below the expected one. Returns nothing if the likelihood is not concave here.
std::optional<Eigen::VectorXd> NewtonStep(const Likelihood& here, const std::vector<Eigen::Index>& free) {
  const Eigen::MatrixXd observed = 2 * here.average(free, free) - here.fisher(free, free);
  const Eigen::VectorXd scale = here.fisher.diagonal()(free).cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return std::nullopt;
  const auto factor = Cholesky(scale.asDiagonal() * observed * scale.asDiagonal());
  if (!factor) return std::nullopt;
  const Eigen::VectorXd step = scale.asDiagonal() * factor->Solve(scale.cwiseProduct(here.gradient(free)));
  return step.allFinite() ? std::optional(step) : std::nullopt;
}

// Returns the variances that a step may change. A variance at zero stays there unless its gradient is positive, and one
// at its largest value if it is.
std::vector<Eigen::Index> MovingVariances(const std::vector<VarianceGroup>& groups, const Eigen::VectorXd& variances,
                                          const Eigen::VectorXd& gradient) {
  std::vector<Eigen::Index> moving;
  for (Eigen::Index k = 0; k < variances.size(); ++k) {
    const VarianceGroup& group = groups[static_cast<size_t>(k)];
    const bool stays = gradient[k] > 0 ? variances[k] >= group.most : variances[k] <= 0;
    if (group.is_free && !stays) moving.push_back(k);
  }
  return moving;
}

// Returns the estimated variances with their uncertainty, by the Fisher information near them.
VarianceComponents ComponentsOf(const std::vector<VarianceGroup>& groups, const Eigen::VectorXd& variances,
                                const Eigen::MatrixXd& fisher) {
  VarianceComponents result;
  result.variances = variances;
  result.stddev.setZero(variances.size());
  result.covariance.setZero(variances.size(), variances.size());
  std::vector<Eigen::Index> uncertain;
  for (Eigen::Index k = 0; k < variances.size(); ++k) {
    if (!groups[static_cast<size_t>(k)].is_free || !(fisher(k, k) > 0)) continue;
    result.stddev[k] = 1 / std::sqrt(fisher(k, k));
    // A variance that is zero is taken as certain, and so is one that cannot be told from zero: it is more likely too
    // large than too small, so the covariance is wide enough without further degrees of freedom.
    constexpr double kToldFromZero = 0.75;
    const bool is_told = groups[static_cast<size_t>(k)].avoids_zero || result.stddev[k] < kToldFromZero * variances[k];
    if (is_told) uncertain.push_back(k);
  }
  if (!uncertain.empty()) {
    const Eigen::MatrixXd of_uncertain = fisher(uncertain, uncertain);
    const Eigen::VectorXd scale = of_uncertain.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd inverse = InverseOfSymmetric(scale.asDiagonal() * of_uncertain * scale.asDiagonal());
    result.covariance(uncertain, uncertain) = scale.asDiagonal() * inverse * scale.asDiagonal();
  }
  return result;
}

}  // namespace

double RestrictedLogLikelihood(const std::vector<LinearisedView>& all_views, double unit_px,
                               const std::vector<VarianceGroup>& groups, Eigen::Index num_common) {
  CHECK(!all_views.empty());
  std::vector<LinearisedView> views = all_views;
  double num_rows = 0;
  for (LinearisedView& view : views) {
    view.by_unknowns.conservativeResize(Eigen::NoChange, num_common);
    num_rows += static_cast<double>(view.offset.size() + view.num_residual_dof);
  }
  const Eigen::VectorXd variances = VariancesOf(groups);
  const Likelihood likelihood =
      WithPriors(groups, variances, MakeLikelihood(views, groups)->At(variances, Curvature::kAverage));
  return -likelihood.minus_log - num_rows * std::log(unit_px);
}

std::optional<LikelihoodScores> ScoresOf(const std::vector<LinearisedView>& views,
                                         const std::vector<VarianceGroup>& groups) {
  const Eigen::VectorXd variances = VariancesOf(groups);
  Likelihood likelihood =
      WithPriors(groups, variances, MakeLikelihood(views, groups)->At(variances, Curvature::kAverageAndExpected));
  if (!std::isfinite(likelihood.minus_log)) return std::nullopt;
  return LikelihoodScores{-likelihood.minus_log, std::move(likelihood.gradient), std::move(likelihood.fisher)};
}

namespace {

// Variances, and likelihood times prior at the last step before them.
struct LikelyVariances {
  Eigen::VectorXd variances;
  Likelihood likelihood;  // With the expected information.
};

// Returns the variances of the groups that maximise likelihood times prior, as EstimateVariances. If those of the
// groups are near them, the average information leads there, and the expected one, which costs more, confirms that
// nothing is left to be gained. From far away, the average information may lead to another maximum; Fisher scoring
// leads to where Newton's method, which needs fewer steps, finds the same.
LikelyVariances MaximiseLikelihood(const RestrictedLikelihood& restricted, const std::vector<VarianceGroup>& groups,
                                   double small_change, VarianceStart start) {
  bool is_expected = start == VarianceStart::kAnywhere;
  const auto at = [&](const Eigen::VectorXd& variances) {
    return WithPriors(groups, variances,
                      restricted.At(variances, is_expected ? Curvature::kAverageAndExpected : Curvature::kAverage));
  };
  Eigen::VectorXd variances = VariancesOf(groups);
  Likelihood here = at(variances);
  constexpr int kMaxIterations = 100;
  constexpr double kMinPixelVariance = 1e-12;
  constexpr double kMostFall = 0.1;  // Largest decrease per step, towards a zero that a prior excludes.
  for (int iteration = 0; iteration < kMaxIterations && std::isfinite(here.minus_log); ++iteration) {
    const std::vector<Eigen::Index> free = MovingVariances(groups, variances, here.gradient);
    const Eigen::VectorXd scoring = free.empty() ? Eigen::VectorXd() : ScoringStep(here, free);
    const auto moved_by = [&](const Eigen::VectorXd& direction, double length) {
      Eigen::VectorXd next = variances;
      for (size_t a = 0; a < free.size(); ++a) {
        const Eigen::Index k = free[a];
        const VarianceGroup& group = groups[static_cast<size_t>(k)];
        const bool has_prior = group.prior.has_value() || group.avoids_zero;
        const double least = k == 0 ? kMinPixelVariance : has_prior ? kMostFall * variances[k] : 0.0;
        next[k] =
            std::min(group.most, std::max(least, variances[k] + length * direction[static_cast<Eigen::Index>(a)]));
      }
      return next;
    };
    const auto moves_to = [&](const Eigen::VectorXd& next) {
      Likelihood there = at(next);
      if (!(there.minus_log <= here.minus_log)) return false;
      variances = next;
      here = std::move(there);
      return true;
    };
    bool has_moved = false;
    if (scoring.size() > 0 && scoring.allFinite()) {
      // The change is measured in units of the variances' standard deviations.
      const Eigen::VectorXd unit = (is_expected ? here.fisher : here.average).diagonal().cwiseMax(0).cwiseSqrt();
      const auto change = [&](const Eigen::VectorXd& next) {
        return (next - variances).cwiseAbs().cwiseProduct(unit).maxCoeff();
      };
      constexpr double kNear = 1;
      const bool is_near = is_expected && change(moved_by(scoring, 1)) < kNear;
      const std::optional<Eigen::VectorXd> newton = is_near ? NewtonStep(here, free) : std::nullopt;
      const Eigen::VectorXd last = moved_by(newton ? *newton : scoring, 1);
      const bool is_small = change(last) < small_change;
      if (is_small && is_expected) {
        variances = last;
        break;
      }
      // Scoring may lead on where a bound cuts Newton's step off.
      has_moved = newton && moves_to(last);
      double length = 1;
      for (int halving = 0; halving < 30 && !has_moved && !is_small; ++halving, length *= 0.5) {
        has_moved = moves_to(moved_by(scoring, length));
      }
    }
    if (has_moved) continue;
    if (is_expected) break;
    is_expected = true;
    here = at(variances);
  }
  return {std::move(variances), std::move(here)};
}

}  // namespace

VarianceComponents EstimateVariances(const std::vector<LinearisedView>& views, const std::vector<VarianceGroup>& groups,
                                     double small_change) {
  const LikelyVariances found =
      MaximiseLikelihood(*MakeLikelihood(views, groups), groups, small_change, VarianceStart::kAnywhere);
  return ComponentsOf(groups, found.variances, found.likelihood.fisher);
}

double FitVariances(const std::vector<LinearisedView>& views, VarianceStart start, std::vector<VarianceGroup>* groups) {
  const LikelyVariances found = MaximiseLikelihood(*MakeLikelihood(views, *groups), *groups, kRoughVariances, start);
  for (size_t g = 0; g < groups->size(); ++g) (*groups)[g].variance = found.variances[static_cast<Eigen::Index>(g)];
  return -found.likelihood.minus_log;
}

double DegreesOfFreedom(const std::vector<LinearisedView>& views, const std::vector<VarianceGroup>& groups,
                        const VarianceComponents& variances) {
  constexpr double kCertain = std::numeric_limits<double>::infinity();
  constexpr double kLeast = 4;
  if (variances.covariance.isZero(0)) return kCertain;
  std::optional<InformationAndDerivatives> at = MakeLikelihood(views, groups)->InformationAt(variances.variances);
  if (!at) return kLeast;
  const Eigen::Index n = at->information.cols();
  // Coordinates in which the covariance is the identity, and in which the effects of the variances are decoupled as
  // far as possible.
  const Eigen::VectorXd scale = at->information.diagonal().cwiseSqrt().cwiseInverse();
  const auto root = Cholesky(scale.asDiagonal() * at->information * scale.asDiagonal());
  if (!root) return kLeast;
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(n, n);
  for (size_t k = 0; k < at->derivatives.size(); ++k) {
    Eigen::MatrixXd& fall = at->derivatives[k];
    fall = (scale.asDiagonal() * fall * scale.asDiagonal()).eval();
    fall = root->SolveLower(root->SolveLower(fall).transpose());
    const auto i = static_cast<Eigen::Index>(k);
    total += std::sqrt(variances.covariance(i, i)) * fall;
  }
  const SymmetricEigen<Eigen::Dynamic> eigen = EigenOfSymmetric(total);
  double sum = 0;
  Eigen::VectorXd slope(variances.variances.size());
  for (Eigen::Index m = 0; m < n; ++m) {
    for (size_t k = 0; k < at->derivatives.size(); ++k) {
      slope[static_cast<Eigen::Index>(k)] = eigen.vectors.col(m).dot(at->derivatives[k] * eigen.vectors.col(m));
    }
    const double dof = 2 / slope.dot(variances.covariance * slope);
    if (dof <= 2) return kLeast;
    sum += dof / (dof - 2);
  }
  return sum > static_cast<double>(n) ? std::max(kLeast, 2 * sum / (sum - static_cast<double>(n))) : kCertain;
}

}  // namespace heba
