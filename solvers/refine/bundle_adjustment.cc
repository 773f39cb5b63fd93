#include "heba/bundle_adjustment.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "heba/base/text.h"
#include "heba/evaluation/metrics.h"
#include "solvers/closed_form/motion_analysis.h"
#include "solvers/refine/bundle_model.h"
#include "solvers/refine/noise_iteration.h"
#include "solvers/refine/point_rejection.h"
#include "solvers/refine/uncertainty_limits.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {

std::string BundleOptions::Check() const {
  std::vector<std::string> faults;
  if (pixel_noise_px && !(*pixel_noise_px > 0)) faults.emplace_back("pixel_noise_px must be greater than zero");
  if (robot == Robot::kGivenNoise && !(robot_noise.translation_m >= 0 && robot_noise.rotation_rad >= 0)) {
    faults.emplace_back("robot_noise must not be negative");
  }
  if (max_iterations < 1) faults.emplace_back("max_iterations must be at least 1");
  return Join(faults, "\n");
}

FreeUnknowns FreeOf(const CameraModel& model, const BundleOptions& options) {
  return {FreeOf(model, options.free_intrinsics, options.free_shape), options.effects};
}

const Loss& InlierLoss(const BundleOptions& options) {
  return LossOf(options.loss == LossKind::kTruncated ? LossKind::kNone : options.loss);
}

namespace {

// Returns what the sigmas of the camera's pose are compared with.
std::vector<CameraReach> ReachOf(const Problem& problem, const FreeUnknowns& free, const FitState& state) {
  std::vector<Rigid3d> camera_from_target;
  for (size_t i = 0; i < problem.views.size(); ++i) {
    camera_from_target.push_back(PredictedPose(problem, free, state, i));
  }
  return {CameraReach{std::string(kHandEyeBlock), WorkingDistance(camera_from_target)}};
}

}  // namespace

Outcome<Solution> RefineHandEye(const Problem& problem_in, const HandEye& start, const BundleOptions& options) {
  const std::string faults = options.Check();
  CHECK(faults.empty()) << faults;
  const bool is_truncated = options.loss == LossKind::kTruncated;
  const FreeUnknowns free = FreeOf(problem_in.camera.Model(), options);

  std::vector<Rigid3d> poses;
  for (const View& view : problem_in.views) poses.push_back(view.camera_mount_from_target_mount);
  const std::string why_not = WhyNotObservable(AnalyseMotion(poses));
  if (!why_not.empty()) return Failure{why_not};
  FitState start_state{start, problem_in.camera, problem_in.shape, {}, {}};
  if (options.effects != nullptr) start_state.effects.setZero(options.effects->size());
  const ViewDistances start_distances = SquaredDistances(problem_in, free, start_state, options.num_threads);
  PointFlags keep;
  std::vector<std::string> hidden;
  for (size_t i = 0; i < problem_in.views.size(); ++i) {
    const bool is_visible = start_distances[i].has_value();
    keep.emplace_back(static_cast<size_t>(problem_in.views[i].observations.size()), is_visible);
    if (!is_visible) hidden.push_back(problem_in.views[i].name);
  }
  // A few captures may have a wrong pose, which `truncated` tolerates.
  if (hidden.size() > (is_truncated ? keep.size() / 2 : 0)) {
    return Failure{"at the initial guess the target of capture " + hidden.front() +
                   " lies behind the camera; try another seed, or check the setup and the direction of the poses"};
  }
  const SharedProblem visible = KeepFlaggedPoints(problem_in, keep);
  const Problem& problem = *visible;
  const UnknownLayout layout = HandEyeUnknowns(problem.camera.Model(), free);
  if (const std::optional<Failure> failure = CheckNumPoints(CountFlags(keep), layout)) return *failure;
  // Observability is checked at sigma = 0.05 px: a direction that is unobservable even then cannot be solved for.
  constexpr double kLittleNoisePx = 0.05;
  Fit fit;
  fit.problem = visible;
  fit.groups = std::make_shared<const PoseGroups>(GroupByRobotPose(problem.setup, problem.views));
  fit.state = start_state;
  fit.noise.pixel_px = options.pixel_noise_px.value_or(kLittleNoisePx);
  for (size_t g = 0; options.effects != nullptr && g < options.effects->groups.size(); ++g) {
    fit.noise.effect_sigmas.push_back(options.effects->groups[g].sigma);
  }
  const std::optional<Information> start_information = FitInformation(free, LossOf(LossKind::kNone), options, &fit);
  if (!start_information) return HiddenPoint();
  if (const std::optional<Failure> failure = CheckObservable(*start_information)) return *failure;
  if (const std::optional<Failure> failure =
          CheckDetermined(InvertInformation(*start_information, 1.0), ReachOf(problem, free, start_state))) {
    return *failure;
  }

  fit.noise.pixel_px =
      options.pixel_noise_px ? *options.pixel_noise_px : SigmaFromMedian(JoinDistances(start_distances));
  if (options.robot != BundleOptions::Robot::kExact) {
    fit.state.corrections.assign(problem.views.size(), Rigid3d());
    fit.noise.robot = AtLeastExact(options.robot == BundleOptions::Robot::kEstimatedNoise ? options.robot_noise_start
                                                                                          : options.robot_noise);
  }
  const double detector_px = TypicalDetectorSigma(problem.views).value_or(0);
  if (options.pixel_noise_px && detector_px > 0)
    fit.unmodelled_sigma_px = UnmodelledSigmaPx(*options.pixel_noise_px, detector_px);

  const Loss& loss = InlierLoss(options);
  Outcome<Fit> settled = is_truncated ? RefineWithRejection(problem_in, std::move(fit), free, options, &keep)
                                      : IterateNoiseAndFit(std::move(fit), free, loss, NoiseScale::kOfFit, options);
  if (!settled) return Failure{settled.reason()};
  Solution solution;
  solution.hand_eye = settled->state.hand_eye;
  solution.camera = settled->state.camera;
  solution.shape = settled->state.shape;
  solution.shared_effects = options.effects;
  solution.effects = settled->state.effects;
  solution.effect_sigmas = settled->noise.effect_sigmas;
  if (options.effects != nullptr && options.effects->kind == SharedEffectsKind::kSmooth) {
    solution.smooth_noise = RobotNoise{solution.effect_sigmas[0], solution.effect_sigmas[1]};
  }
  solution.pixel_sigma_px = settled->noise.pixel_px;
  solution.unmodelled_sigma_px = settled->unmodelled_sigma_px;
  solution.covariance_dof = settled->dof;
  solution.robot_noise = settled->noise.robot;
  if (options.robot == BundleOptions::Robot::kEstimatedNoise) solution.robot_noise_stddev = settled->robot_stddev;
  for (size_t i = 0; i < keep.size(); ++i) {
    ViewOutcome& outcome = solution.views.emplace_back();
    if (!settled->state.corrections.empty()) outcome.correction = settled->state.corrections[i];
    for (size_t k = 0; k < keep[i].size(); ++k) {
      if (!keep[i][k]) outcome.rejected_ids.push_back(problem_in.views[i].observations.ids[k]);
    }
  }
  solution.convergence = settled->convergence;
  const PoseGroups& groups = *settled->groups;
  solution.convergence.initial_cost =
      FitCost(problem_in, start_distances, start_state, groups, free, settled->noise, loss);
  const std::optional<ViewDistances> distances =
      DistancesAt(*settled->problem, free, settled->state, options.num_threads);
  if (!distances) return HiddenPoint();
  solution.convergence.final_cost = FitCost(problem_in, *distances, settled->state, groups, free, settled->noise, loss);
  const std::optional<Information> information = FitInformation(free, loss, options, &*settled);
  if (!information) return HiddenPoint();
  if (const std::optional<Failure> failure = CheckObservable(*information)) return *failure;
  solution.covariance = InvertInformation(*information, 1.0);
  const std::string camera_faults = CheckCamera(solution.camera);
  if (!camera_faults.empty()) return Failure{"the refined camera is implausible: " + camera_faults};
  if (const std::optional<Failure> failure =
          CheckDetermined(solution.covariance, ReachOf(*settled->problem, free, settled->state))) {
    return *failure;
  }
  return solution;
}

namespace {

// The rows and the variances of a solution, by which its restricted likelihood is computed.
struct SolutionRows {
  std::vector<LinearisedView> views;
  std::vector<VarianceGroup> groups;
  Eigen::Index num_common;

  double LogLikelihood(double pixel_sigma_px) const {
    return RestrictedLogLikelihood(views, pixel_sigma_px, groups, num_common);
  }
};

// Returns nothing if a point cannot be projected.
std::optional<SolutionRows> RowsOf(const Problem& problem, const Solution& solution, const BundleOptions& options) {
  const FreeUnknowns free = FreeOf(solution.camera.Model(), options);
  const Loss& loss = InlierLoss(options);
  const FitState state{solution.hand_eye, solution.camera, solution.shape, solution.effects, CorrectionsOf(solution)};
  const FitNoise noise{solution.pixel_sigma_px, solution.robot_noise, solution.effect_sigmas};
  std::optional<std::vector<LinearisedView>> views = LineariseFit(
      problem, state, GroupByRobotPose(problem.setup, problem.views), free, noise, loss, loss.consistency, options);
  if (!views) return std::nullopt;
  const UnknownLayout layout = HandEyeUnknowns(solution.camera.Model(), free);
  std::vector<VarianceGroup> groups =
      WithEffectGroups(CorrectionGroups(loss.consistency, solution.robot_noise.value_or(RobotNoise{}), true, true,
                                        options.robot_noise_prior ? &*options.robot_noise_prior : nullptr,
                                        NumNoisyJoints(problem.views)),
                       layout.Block(kRobotBlock), options.effects.get(), solution.effect_sigmas, true, false);
  return SolutionRows{std::move(*views), std::move(groups), layout.Block(kTargetBlock).first};
}

}  // namespace

double LogLikelihoodOf(const Problem& problem, const Solution& solution, const BundleOptions& options) {
  const std::optional<SolutionRows> rows = RowsOf(problem, solution, options);
  return rows ? rows->LogLikelihood(solution.pixel_sigma_px) : -std::numeric_limits<double>::infinity();
}

std::optional<double> LogLikelihoodAtLeast(const Problem& problem, const Solution& solution,
                                           const BundleOptions& options, const SharedEffects& smaller) {
  if (options.effects == nullptr) return std::nullopt;
  std::optional<SolutionRows> rows = RowsOf(problem, solution, options);
  if (!rows || !RaiseToLeast(rows->views, *options.effects, smaller, &rows->groups)) return std::nullopt;
  return rows->LogLikelihood(solution.pixel_sigma_px);
}

}  // namespace heba
