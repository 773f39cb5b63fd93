#include "heba/refinement.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/base/text.h"
#include "solvers/refine/fit_start.h"
#include "solvers/refine/noise_iteration.h"
#include "solvers/refine/point_rejection.h"
#include "solvers/refine/uncertainty_limits.h"

namespace heba {
namespace {

Solution SolutionOf(const Problem& problem, const Fit& fit, const PointFlags& keep, const AdjustmentOptions& options) {
  Solution solution;
  solution.poses = fit.state.poses;
  solution.cameras = fit.state.cameras;
  solution.shapes = fit.state.shapes;
  solution.pixel_sigmas_px = fit.noise.pixel_px;
  solution.image_sigmas_px = fit.noise.image_px;
  solution.unmodelled_sigma_px = fit.unmodelled_sigma_px;
  solution.effects = fit.state.effects;
  solution.effect_sigmas = fit.noise.effect_sigmas;
  solution.smooth_noise.resize(problem.robots.size());
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr || effects->kind != SharedEffectsKind::kSmooth) continue;
    const std::vector<double>& sigmas = fit.noise.effect_sigmas[r];
    solution.smooth_noise[r] = RobotNoise{sigmas[0], sigmas[1]};
  }
  solution.robot_noise.resize(problem.robots.size());
  solution.robot_noise_stddev.resize(problem.robots.size());
  const std::vector<size_t> moving = MovingRobots(*fit.problem);
  for (size_t k = 0; k < fit.noise.robots.size(); ++k) {
    solution.robot_noise[moving[k]] = fit.noise.robots[k];
    if (options.robot == BundleOptions::Robot::kEstimatedNoise) {
      solution.robot_noise_stddev[moving[k]] = fit.robot_stddev[k];
    }
  }
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    CaptureOutcome& outcome = solution.captures.emplace_back();
    if (!fit.state.corrections.empty()) outcome.corrections = fit.state.corrections[i];
    for (size_t k = 0; k < keep[i].size(); ++k) {
      std::vector<int>& rejected = outcome.rejected_ids.emplace_back();
      for (size_t p = 0; p < keep[i][k].size(); ++p) {
        if (!keep[i][k][p]) rejected.push_back(problem.captures[i].images[k].observations.ids[p]);
      }
    }
  }
  solution.covariance_dof = fit.dof;
  solution.convergence = fit.convergence;
  return solution;
}

}  // namespace

std::string AdjustmentOptions::Check() const {
  std::vector<std::string> faults;
  if (pixel_noise_px && !(*pixel_noise_px > 0)) faults.emplace_back("pixel_noise_px must be greater than zero");
  const auto is_positive = [](double sigma_px) { return sigma_px > 0; };
  if (!std::all_of(pixel_noise_start_px.begin(), pixel_noise_start_px.end(), is_positive)) {
    faults.emplace_back("pixel_noise_start_px must be greater than zero");
  }
  if (robot == BundleOptions::Robot::kGivenNoise &&
      !(robot_noise.translation_m >= 0 && robot_noise.rotation_rad >= 0)) {
    faults.emplace_back("robot_noise must not be negative");
  }
  if (max_iterations < 1) faults.emplace_back("max_iterations must be at least 1");
  return Join(faults, "\n");
}

Outcome<Solution> RefineProblem(const Problem& problem, const CellPoses& start, const AdjustmentOptions& options) {
  const std::string faults = options.Check();
  CHECK(faults.empty()) << faults;
  CHECK(options.pixel_noise_start_px.empty() || options.pixel_noise_start_px.size() == problem.cameras.size());
  Outcome<FitStart> started = StartFit(problem, start, options);
  if (!started) return started.failure();
  const Fit& at_start = started->fit;
  PointFlags& keep = started->keep;
  const bool is_truncated = options.loss == LossKind::kTruncated;
  const Loss& loss = LossOf(is_truncated ? LossKind::kNone : options.loss);
  Outcome<Fit> settled = is_truncated ? RefineWithRejection(problem, at_start, options, &keep)
                                      : IterateNoiseAndFit(at_start, loss, NoiseScale::kOfFit, options);
  if (!settled) return settled.failure();
  Solution solution = SolutionOf(problem, *settled, keep, options);
  // Both costs are those of the noise that was found.
  solution.convergence.initial_cost = FitCost(*at_start.problem, at_start.groups, at_start.state, settled->noise, loss);
  solution.convergence.final_cost = FitCost(*settled->problem, settled->groups, settled->state, settled->noise, loss);
  const std::optional<Information> information = FitInformation(*settled, loss, options.num_threads);
  if (!information) return HiddenPoint();
  if (const std::optional<Failure> failure = CheckObservable(*information)) return *failure;
  solution.covariance = InvertInformation(*information, 1.0);
  for (size_t c = 0; c < solution.cameras.size(); ++c) {
    const std::string camera_faults = CheckCamera(solution.cameras[c]);
    if (camera_faults.empty()) continue;
    const std::string& name = problem.cameras[c].name;
    return Failure{FailureCode("implausible_refined_camera"), {}, {{"camera", name}, {"faults", camera_faults}}};
  }
  const std::optional<Failure> failure = CheckDetermined(*settled->problem, settled->state, solution.covariance);
  if (failure) return *failure;
  return solution;
}

}  // namespace heba
