#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "heba/refinement.h"
#include "solvers/refine/fit.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// The rows and the variances of a solution, by which its restricted likelihood is computed.
struct SolutionRows {
  std::vector<LinearisedView> views;
  std::vector<VarianceGroup> groups;
  Eigen::Index num_common;
  double log_unit = 0;  // The logarithm of the density of the whitened rows, of those of the measurements in px.

  double LogLikelihood() const { return RestrictedLogLikelihood(views, 1, groups, num_common) - log_unit; }
};

// Returns the logarithm of the product of the standard deviations by which the rows of all images were whitened.
double LogUnitOf(const Problem& problem, const FitNoise& noise) {
  double sum = 0;
  for (const ProblemCapture& capture : problem.captures) {
    for (const ProblemImage& image : capture.images) {
      if (image.observations.size() == 0) continue;
      const double num_rows = 2.0 * image.observations.size();
      sum += num_rows * std::log(noise.pixel_px[image.camera]) +
             0.5 * std::min(6.0, num_rows) * std::log(PoseVarianceRatio(noise, image));
    }
  }
  return sum;
}

// Returns nothing if a point cannot be projected.
std::optional<SolutionRows> RowsOf(Problem problem, const Solution& solution, const AdjustmentOptions& options) {
  const Loss& loss = LossOf(options.loss == LossKind::kTruncated ? LossKind::kNone : options.loss);
  for (size_t c = 0; c < problem.cameras.size(); ++c) problem.cameras[c].camera = solution.cameras[c];
  const FitNoise noise = NoiseOf(solution);
  std::optional<std::vector<LinearisedView>> views =
      LineariseFit(problem, GroupByRobotPoses(problem), StateOf(solution), noise, loss, loss.consistency);
  if (!views) return std::nullopt;
  VarianceSetting setting;
  setting.pixel_variance = loss.consistency;
  setting.robot_prior = options.robot_noise_prior;
  setting.effects_avoid_zero = false;  // Models are compared without that.
  return SolutionRows{std::move(*views), VarianceGroupsOf(problem, noise, setting),
                      UnknownsOf(problem).BlocksOf(UnknownOwner::kTarget).front().first, LogUnitOf(problem, noise)};
}

}  // namespace

double LogLikelihoodOf(const Problem& problem, const Solution& solution, const AdjustmentOptions& options) {
  const std::optional<SolutionRows> rows = RowsOf(problem, solution, options);
  return rows ? rows->LogLikelihood() : -std::numeric_limits<double>::infinity();
}

std::optional<double> LogLikelihoodAtLeast(const Problem& problem, const Solution& solution,
                                           const AdjustmentOptions& options,
                                           const std::vector<std::shared_ptr<const SharedEffects>>& smaller) {
  std::optional<SolutionRows> rows = RowsOf(problem, solution, options);
  if (!rows) return std::nullopt;
  bool has_raised = false;
  size_t first = FirstEffectGroup(rows->groups);
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr) continue;
    if (smaller[r] != nullptr && RaiseToLeast(*effects, *smaller[r], first, &rows->groups)) has_raised = true;
    first += effects->groups.size();
  }
  if (!has_raised) return std::nullopt;
  FitVariances(rows->views, VarianceStart::kAnywhere, &rows->groups);
  return rows->LogLikelihood();
}

}  // namespace heba
