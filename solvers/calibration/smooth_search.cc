#include "solvers/calibration/smooth_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "heba/base/units.h"

namespace heba {
namespace {

// Estimates the variances of the groups, and returns the restricted log-likelihood at them.
double LikelihoodOf(const std::vector<LinearisedView>& views, double unit_px, std::vector<VarianceGroup>* groups) {
  FitVariances(views, groups);
  return RestrictedLogLikelihood(views, unit_px, *groups, views.front().by_unknowns.cols());
}

// Returns the log-likelihood of smooth errors, whose standard deviations become the most likely ones.
double LikelihoodWith(const SmoothSearch& search, SmoothErrors* errors) {
  std::vector<LinearisedView> extended = search.views;
  const Eigen::Index n = search.views.front().by_unknowns.cols();
  const SharedEffects& effects = errors->effects();
  for (size_t i = 0; i < extended.size(); ++i) {
    extended[i].by_unknowns.conservativeResize(Eigen::NoChange, n + effects.size());
    auto by_errors = extended[i].by_unknowns.rightCols(effects.size());
    by_errors.setZero();
    if (i >= search.poses.size()) continue;
    by_errors =
        search.views[i].by_effects.middleCols<6>(search.first_column) * errors->GripperByEffects(search.poses[i]);
  }
  std::vector<VarianceGroup> groups = search.groups;
  const size_t first = groups.size();
  for (const EffectGroup& group : effects.groups) {
    groups.push_back({VarianceGroup::Kind::kUnknowns, {}, group.sigma * group.sigma, true});
  }
  for (Eigen::Index k = 0; k < effects.size(); ++k) {
    groups[first + effects.effects[static_cast<size_t>(k)].group].columns.push_back(n + k);
  }
  const double log_likelihood = LikelihoodOf(extended, search.unit_px, &groups);
  std::vector<double> sigmas;
  for (size_t g = first; g < groups.size(); ++g) {
    constexpr double kLeast = 1e-6;  // m, rad: the refinement starts from these figures.
    sigmas.push_back(std::max(kLeast, std::sqrt(groups[g].variance)));
  }
  errors->SetSigmas(sigmas);
  return log_likelihood;
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
  SmoothSearch thinned{{}, {}, search.unit_px, search.groups, search.first_column};
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
  std::vector<VarianceGroup> groups = search.groups;
  const double log_likelihood_without = LikelihoodOf(search.views, search.unit_px, &groups);
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
  return {std::move(best), best_log_likelihood - log_likelihood_without};
}

Finding DescribeSmoothErrors(const RobotNoise& smooth, const SmoothLengths& lengths, const RobotNoise& before,
                             const RobotNoise& after) {
  return {Grade::kGood,
          FindingCode("smooth_errors"),
          {{"smooth_mm", 1000 * smooth.translation_m},
           {"smooth_deg", RadToDeg(smooth.rotation_rad)},
           {"length_mm", 1000 * lengths.translation_m},
           {"length_deg", RadToDeg(lengths.rotation_rad)},
           {"before_mm", 1000 * before.translation_m},
           {"before_deg", RadToDeg(before.rotation_rad)},
           {"after_mm", 1000 * after.translation_m},
           {"after_deg", RadToDeg(after.rotation_rad)}}};
}

}  // namespace heba
