#include "heba/refinement.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/base/text.h"
#include "heba/evaluation/metrics.h"
#include "solvers/refine/noise_iteration.h"
#include "solvers/refine/point_rejection.h"
#include "solvers/refine/uncertainty_limits.h"
#include "solvers/residuals/noise_scale.h"

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

// Returns what the sigmas of each camera's pose are compared with.
std::vector<CameraReach> ReachesOf(const Problem& problem, const FitState& state) {
  std::vector<CameraReach> reaches;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const std::vector<Rigid3d> poses = TargetPosesOf(problem, state.poses, state.effects, c);
    if (!poses.empty()) reaches.push_back({CameraPoseBlock(problem.cameras[c]), WorkingDistance(poses)});
  }
  return reaches;
}

// Returns the Failure if a direction is not determined at an estimate.
std::optional<Failure> CheckCovariance(const Fit& fit, const Covariance& covariance) {
  return CheckDetermined(covariance, ReachesOf(*fit.problem, fit.state));
}

Failure HiddenAtStart(const Problem& problem, const ImageIndex& index) {
  const ProblemCapture& capture = problem.captures[index.capture];
  const std::string& camera = problem.cameras[capture.images[index.image].camera].name;
  return {FailureCode("hidden_at_start"), {}, {{"capture", capture.name}, {"camera", camera}}};
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
  const bool is_truncated = options.loss == LossKind::kTruncated;
  const Loss& loss = LossOf(is_truncated ? LossKind::kNone : options.loss);
  Fit fit;
  fit.state.poses = start;
  for (const ProblemCamera& camera : problem.cameras) fit.state.cameras.push_back(camera.camera);
  for (const ProblemTarget& target : problem.targets) fit.state.shapes.push_back(target.shape);
  fit = WithStartOfEffects(std::move(fit), problem);
  fit.unmodelled_sigma_px.resize(problem.cameras.size());
  PointFlags keep = AllFlags(problem, true);
  UsePoints(problem, keep, &fit);
  if (fit.groups.empty()) return Failure{FailureCode("no_points")};

  const ImageDistances distances = DistancesAt(problem, fit.groups, fit.state, options.num_threads);
  const std::vector<ImageIndex> images = ImagesOf(problem, fit.groups);
  std::vector<std::vector<double>> of_cameras = DistancesOfCameras(problem, fit.groups, distances);
  std::vector<ImageIndex> hidden;
  for (size_t v = 0; v < images.size(); ++v) {
    if (distances[v]) continue;
    std::vector<bool>& flags = keep[images[v].capture][images[v].image];
    std::fill(flags.begin(), flags.end(), false);
    hidden.push_back(images[v]);
  }
  // A few captures may have a wrong pose, which `truncated` tolerates.
  if (hidden.size() > (is_truncated ? images.size() / 2 : 0)) return HiddenAtStart(problem, hidden.front());
  if (!hidden.empty()) UsePoints(problem, keep, &fit);
  if (const std::optional<Failure> failure = CheckNumPoints(problem, keep)) return *failure;

  // Observability is checked at sigma = 0.05 px: a direction that is unobservable even then cannot be solved for.
  constexpr double kLittleNoisePx = 0.05;
  fit.noise.pixel_px.assign(problem.cameras.size(), options.pixel_noise_px.value_or(kLittleNoisePx));
  fit.noise.image_px.assign(problem.cameras.size(), 0);
  const std::optional<Information> start_information =
      FitInformation(fit, LossOf(LossKind::kNone), options.num_threads);
  if (!start_information) return HiddenPoint();
  if (const std::optional<Failure> failure = CheckObservable(*start_information)) return *failure;
  if (const std::optional<Failure> failure = CheckCovariance(fit, InvertInformation(*start_information, 1.0))) {
    return *failure;
  }

  const std::vector<std::vector<const Observations*>> points = PointsOfCameras(*fit.problem);
  for (size_t c = 0; c < of_cameras.size(); ++c) {
    if (!options.pixel_noise_px) {
      const bool is_guessed = !is_truncated && !options.pixel_noise_start_px.empty();
      fit.noise.pixel_px[c] = is_guessed ? options.pixel_noise_start_px[c] : SigmaFromMedian(std::move(of_cameras[c]));
      continue;
    }
    const double detector_px = TypicalDetectorSigma(points[c]).value_or(0);
    if (detector_px > 0) fit.unmodelled_sigma_px[c] = UnmodelledSigmaPx(*options.pixel_noise_px, detector_px);
  }
  if (options.robot != BundleOptions::Robot::kExact) {
    fit.state.corrections.assign(problem.captures.size(), std::vector<Rigid3d>(problem.robots.size()));
    const bool is_estimated = options.robot == BundleOptions::Robot::kEstimatedNoise;
    fit.noise.robots.assign(MovingRobots(*fit.problem).size(),
                            AtLeastExact(is_estimated ? options.robot_noise_start : options.robot_noise));
  }
  const Fit at_start = fit;
  Outcome<Fit> settled = is_truncated ? RefineWithRejection(problem, std::move(fit), options, &keep)
                                      : IterateNoiseAndFit(std::move(fit), loss, NoiseScale::kOfFit, options);
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
  if (const std::optional<Failure> failure = CheckCovariance(*settled, solution.covariance)) return *failure;
  return solution;
}

}  // namespace heba
