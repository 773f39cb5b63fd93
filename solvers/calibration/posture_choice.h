// The posture of an arm in each capture, if only its poses are known: an arm reaches a pose in several postures, and
// its errors move the pose differently in each of them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "heba/base/even_indices.h"
#include "heba/robot_errors.h"
#include "solvers/uncertainty/linearisation.h"

namespace heba {

// Captures that are linearised at an estimate without errors of the arm, in their order in time.
struct PosturesOfCaptures {
  std::vector<LinearisedView> views;
  Eigen::VectorXd variances;  // Each belongs to a column of LinearisedView::by_effects.
  // The first of the six columns of by_effects that are the correction of the arm's pose.
  Eigen::Index first_column = 0;
  // For each posture and view: the derivative of the correction by the arm's errors; nothing if the arm cannot reach
  // the pose in this posture. A view has at least one.
  std::vector<std::vector<std::optional<Matrix6X>>> by_errors;
  // The positions of the joints in each of them, rad or m; an empty list if they are not known.
  std::vector<std::vector<Eigen::VectorXd>> joints;
  Eigen::VectorXd error_variances;  // The prior variances of the arm's errors.
};

// Returns the posture of each view under which one set of errors explains all views best. Arms rarely jump from one
// posture to another (LogPriorOf). Errors are estimated from a few consecutive captures in one posture, for many
// such starts, and errors and postures are then estimated in turn until no posture changes. `views` must not be empty,
// and each view must have a posture.
std::vector<size_t> ChoosePostures(const PosturesOfCaptures& captures);

// Returns the logarithm of the prior probability of a choice of postures, but for a constant, by which choices of one
// posture for all views and of several can be compared: each turn of a joint by more than a quarter between consecutive
// views costs the logarithm of the number of views, and each change of the posture that and the logarithm of the number
// of other postures. Several postures must be decidedly more likely than one: they cost ten besides.
double LogPriorOf(const std::vector<size_t>& postures, const PosturesOfCaptures& captures);

// Returns the errors by which the configurations of an arm are told from each other.
const std::shared_ptr<const SharedEffects>& ErrorsOfBranches(const ArmErrorModels& arm);

// Returns the postures of these captures, one per configuration of the arm, at errors of zero: the fields by_errors,
// joints and error_variances. The others, which depend on an estimate, are left to the caller.
PosturesOfCaptures PosturesByErrors(const ArmErrorModels& arm, const std::vector<size_t>& captures);

// Returns the configurations of all captures from those of some, which are in increasing order: another capture is in
// that of the capture before it, as far as the arm can be.
std::vector<size_t> BranchesOfAll(const ArmErrorModels& arm, const std::vector<size_t>& captures,
                                  const std::vector<size_t>& branches);

// An adjustment with the errors of an arm, and the logarithm of its restricted likelihood.
template <class AnySolution>
struct FittedPostures {
  AnySolution solution;
  double log_likelihood = 0;
};

// Returns the configurations of `num_captures` captures of the largest restricted likelihood times prior (LogPriorOf):
// one for all, or one for each capture. Those of single captures are found at `start`, the estimate without errors of
// the arm, and then at the estimate with them, of which less noise remains, until they do not change. `fit` returns an
// adjustment with the errors in these configurations, `choose` the configurations that explain the captures best at an
// estimate; each may return nothing. Returns nothing if no choice can be fitted.
template <class AnySolution, class Fit, class Choose>
std::optional<std::vector<size_t>> MostProbableBranches(const ArmErrorModels& arm, size_t num_captures,
                                                        std::optional<AnySolution> start, Fit fit, Choose choose) {
  if (arm.effects_of_captures.size() == 1) return std::vector<size_t>(num_captures, 0);
  const PosturesOfCaptures all = PosturesByErrors(arm, EvenIndices(num_captures, num_captures));
  std::optional<std::vector<size_t>> best;
  double best_log_posterior = 0;
  const auto try_branches = [&](const std::vector<size_t>& branches) -> std::optional<AnySolution> {
    std::optional<FittedPostures<AnySolution>> fitted = fit(branches);
    if (!fitted) return std::nullopt;
    const double log_posterior = fitted->log_likelihood + LogPriorOf(branches, all);
    if (std::isfinite(log_posterior) && (!best || log_posterior > best_log_posterior)) {
      best = branches;
      best_log_posterior = log_posterior;
    }
    return std::move(fitted->solution);
  };
  for (size_t k = 0; k < arm.effects_of_captures.size(); ++k) {
    const auto& effects = arm.effects_of_captures[k];
    if (std::count(effects.begin(), effects.end(), nullptr) == 0) try_branches(std::vector<size_t>(num_captures, k));
  }
  constexpr int kMaxRounds = 5;
  std::optional<std::vector<size_t>> last;
  for (int round = 0; round < kMaxRounds && start; ++round) {
    std::optional<std::vector<size_t>> branches = choose(*start);
    if (!branches || branches == last) break;
    last = std::move(branches);
    start = try_branches(*last);
  }
  return best;
}

}  // namespace heba
