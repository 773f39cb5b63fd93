#include "solvers/calibration/smooth_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "heba/base/distributions.h"
#include "heba/base/error.h"
#include "heba/base/units.h"
#include "solvers/calibration/choice_levels.h"
#include "solvers/refine/fit.h"

namespace heba {
namespace {

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

// Whether the standard deviations of smooth errors have their prior. The model without them is compared by the
// likelihood alone: the prior says how large they are, and not whether there are any.
enum class SigmaPriors { kNone, kHalfCauchy };

// Returns the groups of the search, and those of the smooth errors. `start` are the variances from which they are
// estimated; an empty list: those that the groups have.
std::vector<VarianceGroup> WithGroups(const SmoothSearch& search, const SharedEffects& effects,
                                      const std::vector<double>& start, SigmaPriors priors) {
  std::vector<VarianceGroup> groups = search.groups;
  const Eigen::Index n = search.views.front().by_unknowns.cols();
  const size_t first = groups.size();
  for (const EffectGroup& group : effects.groups) {
    groups.push_back({VarianceGroup::Kind::kUnknowns, {}, group.sigma * group.sigma, true});
    if (priors == SigmaPriors::kHalfCauchy && group.half_cauchy_sigma > 0)
      groups.back().half_cauchy = group.half_cauchy_sigma;
  }
  for (Eigen::Index k = 0; k < effects.size(); ++k) {
    groups[first + effects.effects[static_cast<size_t>(k)].group].columns.push_back(n + k);
  }
  for (size_t g = 0; g < start.size(); ++g) groups[g].variance = start[g];
  return groups;
}

// The variances of all groups that the captures make most probable, and the logarithm of likelihood times prior.
struct FittedVariances {
  double log_likelihood = -std::numeric_limits<double>::infinity();
  std::vector<double> variances;
};

// Returns those of smooth errors; `start` as in WithGroups.
FittedVariances FitWith(const SmoothSearch& search, const SmoothErrors& errors, const std::vector<double>& start,
                        SigmaPriors priors) {
  std::vector<VarianceGroup> groups = WithGroups(search, errors.effects(), start, priors);
  const VarianceStart at = start.empty() ? VarianceStart::kAnywhere : VarianceStart::kNear;
  FittedVariances fitted{FitVariances(WithUnknowns(search, errors), at, &groups), {}};
  for (const VarianceGroup& group : groups) fitted.variances.push_back(group.variance);
  return fitted;
}

// Returns the standard deviations of smooth errors that were found.
std::vector<double> SmoothSigmas(const SmoothSearch& search, const std::vector<double>& variances) {
  std::vector<double> sigmas;
  for (size_t g = search.groups.size(); g < variances.size(); ++g) {
    constexpr double kLeast = 1e-6;  // m, rad: the refinement starts from these figures.
    sigmas.push_back(std::max(kLeast, std::sqrt(variances[g])));
  }
  return sigmas;
}

// Returns the place of the group of the noise that each capture draws anew in a column of LinearisedView::by_effects.
size_t GroupOfColumn(Eigen::Index column, const std::vector<VarianceGroup>& groups) {
  const auto has_column = [&](const VarianceGroup& group) {
    return group.kind == VarianceGroup::Kind::kEffects &&
           std::find(group.columns.begin(), group.columns.end(), column) != group.columns.end();
  };
  const auto found = std::find_if(groups.begin(), groups.end(), has_column);
  CHECK(found != groups.end());
  return static_cast<size_t>(found - groups.begin());
}

// The least variances that smooth errors of a robot's positions (m^2) and rotations (rad^2) are taken to have.
using LeastVariances = std::array<double, 2>;

// Returns half of the variances that the robot's noise has in the groups `white`.
LeastVariances HalfOfWhite(const SmoothSearch& search, const std::vector<VarianceGroup>& white) {
  return {0.5 * white[GroupOfColumn(search.first_column, white)].variance,
          0.5 * white[GroupOfColumn(search.first_column + 3, white)].variance};
}

// Returns the variances of the smooth errors of the most accurate robots.
LeastVariances OfAccurateRobot() {
  constexpr double kTranslationM = 1e-5;
  const double rotation_rad = DegToRad(0.002);
  return {kTranslationM * kTranslationM, rotation_rad * rotation_rad};
}

// Returns the log-likelihood of smooth errors with at least these variances, of which `fitted` are the most likely
// ones.
double LikelihoodOfLeast(const SmoothSearch& search, const LeastVariances& least, const SmoothErrors& errors,
                         const FittedVariances& fitted) {
  std::vector<VarianceGroup> groups = WithGroups(search, errors.effects(), fitted.variances, SigmaPriors::kNone);
  bool is_less = false;
  for (size_t k = 0; k < 2; ++k) {
    VarianceGroup& smooth = groups[search.groups.size() + k];
    if (smooth.variance >= least[k]) continue;
    smooth.variance = least[k];
    smooth.is_free = false;
    is_less = true;
  }
  return is_less ? FitVariances(WithUnknowns(search, errors), VarianceStart::kAnywhere, &groups)
                 : fitted.log_likelihood;
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
  SmoothSearch thinned{{}, {}, search.groups, search.first_column, search.is_exact_without};
  for (size_t k = 0; k < kMost; ++k) {
    const size_t i = k * num_poses / kMost;
    thinned.views.push_back(search.views[i]);
    thinned.poses.push_back(search.poses[i]);
  }
  const auto first_prior = search.views.begin() + static_cast<std::ptrdiff_t>(num_poses);
  thinned.views.insert(thinned.views.end(), first_prior, search.views.end());
  return thinned;
}

// Lengths in octaves from those that SmoothLengths has without captures: of rotations and of translations.
using Octaves = std::array<double, 2>;
constexpr size_t kRotation = 0;
constexpr size_t kTranslation = 1;

SmoothLengths LengthsAt(const Octaves& octaves) {
  SmoothLengths lengths;
  lengths.rotation_rad *= std::exp2(octaves[kRotation]);
  lengths.translation_m *= std::exp2(octaves[kTranslation]);
  return lengths;
}

Octaves Shifted(Octaves octaves, size_t which, double step) {
  octaves[which] += step;
  return octaves;
}

// Returns the offset of the largest value of a parabola through those at -step, 0 and step, at most half a step; zero
// if one is not finite.
double VertexOffset(double step, double before, double middle, double after) {
  const double curvature = before - 2 * middle + after;
  if (!std::isfinite(curvature) || curvature >= 0) return 0;
  return std::clamp(0.5 * step * (before - after) / curvature, -0.5 * step, 0.5 * step);
}

// The probabilities of lengths, each computed once.
class LengthProbabilities {
 public:
  explicit LengthProbabilities(const SmoothSearch& search) : search_(search) {}

  // Returns the logarithm, but for a constant; minus infinity outside of the limits.
  double LogAt(const Octaves& octaves) {
    const auto [place, is_new] = logs_.try_emplace(octaves, -std::numeric_limits<double>::infinity());
    const SmoothLengths lengths = LengthsAt(octaves);
    if (is_new && IsWithinLimits(lengths)) {
      const FittedVariances fitted =
          FitWith(search_, SmoothErrors(search_.poses, lengths), variances_, SigmaPriors::kHalfCauchy);
      place->second = fitted.log_likelihood + LogPriorAt(octaves);
      if (place->second > best_) {
        best_ = place->second;
        variances_ = fitted.variances;
      }
    }
    return place->second;
  }
  // Returns the most probable lengths. A dozen captures may tell them to a tenth of an octave, and the estimates follow
  // them: lengths that were rounded would jump when a capture is added.
  SmoothLengths MostProbable() {
    Octaves best{};
    constexpr double kFinestStep = 0.25;
    for (double step = 1; step >= kFinestStep; step /= 2) best = Climbed(best, step);
    Octaves vertex = best;
    for (const size_t which : {kRotation, kTranslation}) {
      vertex[which] += VertexOffset(kFinestStep, LogAt(Shifted(best, which, -kFinestStep)), LogAt(best),
                                    LogAt(Shifted(best, which, kFinestStep)));
    }
    return LengthsAt(vertex);
  }
  // Returns the variances at the most probable lengths of all. Those at other lengths are not far from them.
  const std::vector<double>& variances() const { return variances_; }

 private:
  // Lengths of arms scatter by a factor of two.
  static double LogPriorAt(const Octaves& octaves) {
    constexpr double kSigmaOctaves = 1;
    double sum = 0;
    for (const double octave : octaves) sum -= 0.5 * std::pow(octave / kSigmaOctaves, 2);
    return sum;
  }

  // Returns where steps in one length at a time lead, as long as the probability grows.
  Octaves Climbed(Octaves best, double step_octaves) {
    constexpr int kMostRounds = 4;
    bool has_improved = true;
    for (int round = 0; round < kMostRounds && has_improved; ++round) {
      has_improved = false;
      for (const size_t which : {kRotation, kTranslation}) {
        for (const double step : {step_octaves, -step_octaves}) {
          const Octaves other = Shifted(best, which, step);
          if (!(LogAt(other) > LogAt(best))) continue;
          best = other;
          has_improved = true;
          break;
        }
      }
    }
    return best;
  }

  const SmoothSearch& search_;
  std::map<Octaves, double> logs_;
  double best_ = -std::numeric_limits<double>::infinity();
  std::vector<double> variances_;
};

}  // namespace

FoundSmoothErrors FindSmoothErrors(const SmoothSearch& all) {
  const SmoothSearch search = Thinned(all);
  std::vector<VarianceGroup> without = search.groups;
  for (Eigen::Index column = 0; search.is_exact_without && column < 6; ++column) {
    VarianceGroup& group = without[GroupOfColumn(search.first_column + column, without)];
    group.variance = 0;
    group.is_free = false;
  }
  const double log_likelihood_without = FitVariances(search.views, VarianceStart::kAnywhere, &without);
  LengthProbabilities probabilities(search);
  FoundSmoothErrors found{SmoothErrors(search.poses, probabilities.MostProbable())};
  const FittedVariances probable = FitWith(search, found.errors, probabilities.variances(), SigmaPriors::kHalfCauchy);
  found.errors.SetSigmas(SmoothSigmas(search, probable.variances));
  const FittedVariances fitted = FitWith(search, found.errors, probable.variances, SigmaPriors::kNone);
  found.log_likelihood_gain = fitted.log_likelihood - log_likelihood_without;
  found.is_exact_without = search.is_exact_without;
  const LeastVariances least = search.is_exact_without ? OfAccurateRobot() : HalfOfWhite(search, without);
  found.odds_without = std::exp(log_likelihood_without - LikelihoodOfLeast(search, least, found.errors, fitted));
  return found;
}

double PValueWithout(const FoundSmoothErrors& found) {
  // Two standard deviations and two lengths; beside an exact robot, two of white noise.
  const double num_figures = found.is_exact_without ? 6 : 4;
  return ChiSquareTail(2 * found.log_likelihood_gain, num_figures);
}

bool AreLikely(const FoundSmoothErrors& found) {
  return PValueWithout(found) < kRandomErrorsRejected || found.odds_without < kLeastOdds;
}

std::vector<SmoothErrorsOfArm> FindSmoothErrorsOfArms(const Problem& problem, const Solution& solution) {
  const Problem weighted = WeightedAs(solution, problem);
  const CaptureGroups groups = GroupByRobotPoses(weighted);
  const std::vector<size_t> moving = MovingRobots(weighted);
  FitNoise noise = NoiseOf(solution);
  std::vector<SmoothErrorsOfArm> errors;
  std::optional<std::vector<LinearisedView>> views =
      LineariseFit(weighted, groups, StateOf(solution), noise, LossOf(LossKind::kNone), 1);
  if (!views) return errors;
  const bool are_exact = noise.robots.empty();
  // The search starts from this noise if the solution has none.
  constexpr RobotNoise kStart = {1e-4, 1e-3};
  if (are_exact) noise.robots.assign(moving.size(), kStart);
  for (size_t k = 0; k < moving.size(); ++k) {
    if (EffectsOf(weighted, moving[k]) != nullptr) continue;
    SmoothSearch search{*views, {}, VarianceGroupsOf(weighted, noise, {}), 6 * static_cast<Eigen::Index>(k), are_exact};
    for (const std::vector<size_t>& group : groups) {
      search.poses.push_back(weighted.captures[group.front()].base_from_gripper[moving[k]]);
    }
    errors.push_back({moving[k], FindSmoothErrors(search)});
  }
  return errors;
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
