#include "solvers/calibration/smooth_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/units.h"
#include "solvers/calibration/model_choice.h"

namespace heba {
namespace {

// Estimates the variances of the groups, and returns the restricted log-likelihood at them.
double LikelihoodOf(const std::vector<LinearisedView>& views, double unit_px, std::vector<VarianceGroup>* groups) {
  FitVariances(views, groups);
  return RestrictedLogLikelihood(views, unit_px, *groups, views.front().by_unknowns.cols());
}

// Returns the views with the smooth errors as further unknowns.
std::vector<LinearisedView> WithUnknowns(const SmoothSearch& search, const SmoothErrors& errors) {
  std::vector<LinearisedView> extended = search.views;
  const Eigen::Index n = search.views.front().by_unknowns.cols();
  const Eigen::Index size = errors.effects().size();
  for (size_t i = 0; i < extended.size(); ++i) {
    extended[i].by_unknowns.conservativeResize(Eigen::NoChange, n + size);
    auto by_errors = extended[i].by_unknowns.rightCols(size);
    by_errors.setZero();
    if (i >= search.poses.size()) continue;
    by_errors =
        search.views[i].by_effects.middleCols<6>(search.first_column) * errors.GripperByEffects(search.poses[i]);
  }
  return extended;
}

// Returns the groups of the search, and those of the smooth errors.
std::vector<VarianceGroup> WithGroups(const SmoothSearch& search, const SharedEffects& effects) {
  std::vector<VarianceGroup> groups = search.groups;
  const Eigen::Index n = search.views.front().by_unknowns.cols();
  const size_t first = groups.size();
  for (const EffectGroup& group : effects.groups) {
    groups.push_back({VarianceGroup::Kind::kUnknowns, {}, group.sigma * group.sigma, true});
  }
  for (Eigen::Index k = 0; k < effects.size(); ++k) {
    groups[first + effects.effects[static_cast<size_t>(k)].group].columns.push_back(n + k);
  }
  return groups;
}

// Returns the log-likelihood of smooth errors, whose standard deviations become the most likely ones.
double LikelihoodWith(const SmoothSearch& search, SmoothErrors* errors) {
  std::vector<VarianceGroup> groups = WithGroups(search, errors->effects());
  const double log_likelihood = LikelihoodOf(WithUnknowns(search, *errors), search.unit_px, &groups);
  std::vector<double> sigmas;
  for (size_t g = search.groups.size(); g < groups.size(); ++g) {
    constexpr double kLeast = 1e-6;  // m, rad: the refinement starts from these figures.
    sigmas.push_back(std::max(kLeast, std::sqrt(groups[g].variance)));
  }
  errors->SetSigmas(sigmas);
  return log_likelihood;
}

// Returns the group of the noise that each capture draws anew in a column of LinearisedView::by_effects.
VarianceGroup& GroupOfColumn(Eigen::Index column, std::vector<VarianceGroup>* groups) {
  const auto has_column = [&](const VarianceGroup& group) {
    return group.kind == VarianceGroup::Kind::kEffects &&
           std::find(group.columns.begin(), group.columns.end(), column) != group.columns.end();
  };
  const auto found = std::find_if(groups->begin(), groups->end(), has_column);
  CHECK(found != groups->end());
  return *found;
}

// Returns the log-likelihood of smooth errors with at least half of the variances that the robot's noise, in the groups
// `white`, has without them.
double LikelihoodOfHalf(const SmoothSearch& search, std::vector<VarianceGroup> white, const SmoothErrors& errors) {
  const std::vector<LinearisedView> views = WithUnknowns(search, errors);
  std::vector<VarianceGroup> groups = WithGroups(search, errors.effects());
  const double log_likelihood = LikelihoodOf(views, search.unit_px, &groups);
  bool is_less = false;
  for (size_t k = 0; k < 2; ++k) {
    VarianceGroup& smooth = groups[search.groups.size() + k];
    const double least = 0.5 * GroupOfColumn(search.first_column + 3 * static_cast<Eigen::Index>(k), &white).variance;
    if (smooth.variance >= least) continue;
    smooth.variance = least;
    smooth.is_free = false;
    is_less = true;
  }
  return is_less ? LikelihoodOf(views, search.unit_px, &groups) : log_likelihood;
}

// Returns whether the lengths are those between which an arm's workspace can tell: longer ones are constants, and
// shorter ones noise.
bool IsWithinLimits(const SmoothLengths& lengths) {
  return lengths.translation_m > 0.04 && lengths.translation_m < 4 && lengths.rotation_rad > 0.08 &&
         lengths.rotation_rad < 4;
}

// Returns the search with as many poses as tell the lengths, evenly chosen: the cost grows with their number.
SmoothSearch Thinned(const SmoothSearch& search) {
  constexpr size_t kMost = 250;
  const size_t num_poses = search.poses.size();
  if (num_poses <= kMost) return search;
  SmoothSearch thinned{{}, {}, search.unit_px, search.groups, search.first_column, search.is_exact_without};
  for (size_t k = 0; k < kMost; ++k) {
    const size_t i = k * num_poses / kMost;
    thinned.views.push_back(search.views[i]);
    thinned.poses.push_back(search.poses[i]);
  }
  const auto first_prior = search.views.begin() + static_cast<std::ptrdiff_t>(num_poses);
  thinned.views.insert(thinned.views.end(), first_prior, search.views.end());
  return thinned;
}

}  // namespace

FoundSmoothErrors FindSmoothErrors(const SmoothSearch& all) {
  const SmoothSearch search = Thinned(all);
  std::vector<VarianceGroup> without = search.groups;
  for (Eigen::Index column = 0; search.is_exact_without && column < 6; ++column) {
    VarianceGroup& group = GroupOfColumn(search.first_column + column, &without);
    group.variance = 0;
    group.is_free = false;
  }
  const double log_likelihood_without = LikelihoodOf(search.views, search.unit_px, &without);
  SmoothErrors best(search.poses, {});
  double best_log_likelihood = LikelihoodWith(search, &best);
  constexpr double kFactor = 2;
  constexpr int kMostRounds = 4;
  bool has_improved = true;
  for (int round = 0; round < kMostRounds && has_improved; ++round) {
    has_improved = false;
    for (double SmoothLengths::*const length : {&SmoothLengths::rotation_rad, &SmoothLengths::translation_m}) {
      for (const double factor : {kFactor, 1 / kFactor}) {
        SmoothLengths lengths = best.lengths();
        lengths.*length *= factor;
        if (!IsWithinLimits(lengths)) continue;
        SmoothErrors other(search.poses, lengths);
        const double log_likelihood = LikelihoodWith(search, &other);
        if (!(log_likelihood > best_log_likelihood)) continue;
        best_log_likelihood = log_likelihood;
        best = std::move(other);
        has_improved = true;
        break;
      }
    }
  }
  FoundSmoothErrors found{std::move(best), best_log_likelihood - log_likelihood_without};
  if (search.is_exact_without) return found;
  found.odds_of_white = std::exp(log_likelihood_without - LikelihoodOfHalf(search, without, found.errors));
  return found;
}

double PValueWithout(const FoundSmoothErrors& found) {
  // Two standard deviations and two lengths; beside an exact robot, two of white noise.
  const double num_figures = found.odds_of_white ? 4 : 6;
  return ChiSquareTail(2 * found.log_likelihood_gain, num_figures);
}

bool AreLikely(const FoundSmoothErrors& found) {
  return PValueWithout(found) < kRandomErrorsRejected || (found.odds_of_white && *found.odds_of_white < kLeastOdds);
}

Finding DescribeSmoothErrors(const SmoothErrorsFigures& figures) {
  return {Grade::kGood,
          FindingCode("smooth_errors"),
          {{"smooth_mm", 1000 * figures.smooth.translation_m},
           {"smooth_deg", RadToDeg(figures.smooth.rotation_rad)},
           {"length_mm", 1000 * figures.lengths.translation_m},
           {"length_deg", RadToDeg(figures.lengths.rotation_rad)},
           {"before_mm", 1000 * figures.noise_without.translation_m},
           {"before_deg", RadToDeg(figures.noise_without.rotation_rad)},
           {"after_mm", 1000 * figures.noise.translation_m},
           {"after_deg", RadToDeg(figures.noise.rotation_rad)},
           {"p_value", figures.p_value_without}},
          {{"evidence", figures.p_value_without < kRandomErrorsRejected ? "shown" : "not_excluded"}}};
}

}  // namespace heba
