#include "heba/rig_adjustment.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "heba/base/text.h"
#include "heba/evaluation/metrics.h"
#include "solvers/refine/noise_iteration.h"
#include "solvers/refine/point_rejection.h"
#include "solvers/refine/uncertainty_limits.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/rig/rig_fit.h"

namespace heba {
namespace {

RigPointFlags AllFlags(const RigProblem& problem, bool value) {
  RigPointFlags flags;
  for (const RigCapture& capture : problem.captures) {
    std::vector<std::vector<bool>>& of_capture = flags.emplace_back();
    for (const RigImage& image : capture.images) {
      of_capture.emplace_back(static_cast<size_t>(image.observations.size()), value);
    }
  }
  return flags;
}

int CountFlags(const RigPointFlags& flags) {
  int count = 0;
  for (const auto& capture : flags) count += heba::CountFlags(capture);
  return count;
}

// Returns the problem with the flagged points only. Its captures and images keep their indices.
std::shared_ptr<const RigProblem> KeepFlagged(const RigProblem& problem, const RigPointFlags& keep) {
  auto kept = std::make_shared<RigProblem>(problem);
  for (size_t i = 0; i < kept->captures.size(); ++i) {
    for (size_t k = 0; k < kept->captures[i].images.size(); ++k) {
      Observations& observations = kept->captures[i].images[k].observations;
      observations = KeepPoints(observations, keep[i][k]);
    }
  }
  return kept;
}

// Returns flags for the points that pass their test at the estimate.
RigPointFlags FindInlierPoints(const RigProblem& problem, const RigFit& fit) {
  const RigProblem weighted = WeightPoints(problem, fit.unmodelled_sigma_px);
  RigPointFlags flags = AllFlags(problem, false);
  for (size_t i = 0; i < weighted.captures.size(); ++i) {
    for (size_t k = 0; k < weighted.captures[i].images.size(); ++k) {
      const RigImage& image = weighted.captures[i].images[k];
      if (image.observations.size() == 0) continue;
      flags[i][k] = FindInliers(fit.state.cameras[image.camera], PredictedPose(problem, fit.state, {i, k}),
                                ApplyShape(image.observations, fit.state.shapes[image.target]),
                                std::hypot(fit.noise.pixel_px[image.camera], fit.noise.image_px[image.camera]));
    }
  }
  return flags;
}

// Sets the points in use, and the groups of the captures that have any.
void UsePoints(const RigProblem& problem, const RigPointFlags& keep, RigFit* fit) {
  fit->problem = KeepFlagged(problem, keep);
  fit->groups = GroupByRobotPoses(*fit->problem);
}

Outcome<RigFit> RefineWithRejection(const RigProblem& problem, RigFit fit, const RigOptions& options,
                                    RigPointFlags* keep) {
  Outcome<RigFit> settled = IterateRig(std::move(fit), LossOf(LossKind::kCauchy), NoiseScale::kMedian, options);
  constexpr int kMaxRounds = 20;
  for (int round = 0; settled && round < kMaxRounds; ++round) {
    RigPointFlags inliers = FindInlierPoints(problem, *settled);
    if (round > 0 && inliers == *keep) break;
    *keep = std::move(inliers);
    if (const std::optional<Failure> failure = CheckNumPoints(CountFlags(*keep), RigUnknowns(problem))) return *failure;
    RigFit next = *settled;
    const std::vector<size_t> moving = MovingRobots(*next.problem);
    UsePoints(problem, *keep, &next);
    if (MovingRobots(*next.problem) != moving) {
      return Failure{"nearly all points contradict the estimate; check that images and poses belong together"};
    }
    settled = IterateRig(std::move(next), LossOf(LossKind::kNone), NoiseScale::kOfFit, options);
  }
  return settled;
}

RigSolution SolutionOf(const RigProblem& problem, const RigFit& fit, const RigPointFlags& keep,
                       const RigOptions& options) {
  RigSolution solution;
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
    RigCaptureOutcome& outcome = solution.captures.emplace_back();
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
std::vector<CameraReach> ReachesOf(const RigProblem& problem, const RigState& state) {
  std::vector<CameraReach> reaches;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const std::vector<Rigid3d> poses = TargetPosesOf(problem, state.poses, state.effects, c);
    if (!poses.empty()) reaches.push_back({CameraPoseBlock(problem.cameras[c]), WorkingDistance(poses)});
  }
  return reaches;
}

}  // namespace

std::string RigOptions::Check() const {
  std::vector<std::string> faults;
  if (pixel_noise_px && !(*pixel_noise_px > 0)) faults.emplace_back("pixel_noise_px must be greater than zero");
  if (robot == BundleOptions::Robot::kGivenNoise &&
      !(robot_noise.translation_m >= 0 && robot_noise.rotation_rad >= 0)) {
    faults.emplace_back("robot_noise must not be negative");
  }
  if (max_iterations < 1) faults.emplace_back("max_iterations must be at least 1");
  return Join(faults, "\n");
}

Outcome<RigSolution> RefineRig(const RigProblem& problem, const RigPoses& start, const RigOptions& options) {
  const std::string faults = options.Check();
  CHECK(faults.empty()) << faults;
  const bool is_truncated = options.loss == LossKind::kTruncated;
  const Loss& loss = LossOf(is_truncated ? LossKind::kNone : options.loss);
  RigFit fit;
  fit.state.poses = start;
  for (const RigCamera& camera : problem.cameras) fit.state.cameras.push_back(camera.camera);
  for (const RigTarget& target : problem.targets) fit.state.shapes.push_back(target.shape);
  AddEffects(problem, &fit.state, &fit.noise);
  fit.unmodelled_sigma_px.resize(problem.cameras.size());
  RigPointFlags keep = AllFlags(problem, true);
  UsePoints(problem, keep, &fit);
  if (fit.groups.empty()) return Failure{"no image has points of a target"};

  const ViewDistances distances = ImageDistances(*fit.problem, fit.groups, fit.state, options.num_threads);
  const std::vector<ImageIndex> images = ImagesOf(*fit.problem, fit.groups);
  std::vector<std::vector<double>> of_cameras(problem.cameras.size());
  std::vector<std::string> hidden;
  for (size_t v = 0; v < images.size(); ++v) {
    const auto [i, k] = images[v];
    const size_t camera = problem.captures[i].images[k].camera;
    if (distances[v]) {
      of_cameras[camera].insert(of_cameras[camera].end(), distances[v]->begin(), distances[v]->end());
      continue;
    }
    std::fill(keep[i][k].begin(), keep[i][k].end(), false);
    hidden.push_back("target of capture " + problem.captures[i].name + " in camera " + problem.cameras[camera].name);
  }
  if (hidden.size() > (is_truncated ? images.size() / 2 : 0)) {
    return Failure{"at the initial guess the " + hidden.front() +
                   " lies behind the camera; check the mounts and the direction of the poses"};
  }
  if (!hidden.empty()) UsePoints(problem, keep, &fit);
  if (const std::optional<Failure> failure = CheckNumPoints(CountFlags(keep), RigUnknowns(problem))) return *failure;

  // Observability is checked at sigma = 0.05 px: a direction that is unobservable even then cannot be solved for.
  constexpr double kLittleNoisePx = 0.05;
  fit.noise.pixel_px.assign(problem.cameras.size(), options.pixel_noise_px.value_or(kLittleNoisePx));
  fit.noise.image_px.assign(problem.cameras.size(), 0);
  const std::optional<Information> start_information = RigInformation(fit, LossOf(LossKind::kNone));
  if (!start_information) return HiddenPoint();
  if (const std::optional<Failure> failure = CheckObservable(*start_information)) return *failure;
  if (const std::optional<Failure> failure =
          CheckDetermined(InvertInformation(*start_information, 1.0), ReachesOf(*fit.problem, fit.state))) {
    return *failure;
  }

  for (size_t c = 0; c < of_cameras.size() && !options.pixel_noise_px; ++c) {
    fit.noise.pixel_px[c] = SigmaFromMedian(std::move(of_cameras[c]));
  }
  if (options.robot != BundleOptions::Robot::kExact) {
    fit.state.corrections.assign(problem.captures.size(), std::vector<Rigid3d>(problem.robots.size()));
    const bool is_estimated = options.robot == BundleOptions::Robot::kEstimatedNoise;
    fit.noise.robots.assign(MovingRobots(*fit.problem).size(),
                            AtLeastExact(is_estimated ? options.robot_noise_start : options.robot_noise));
  }
  Outcome<RigFit> settled = is_truncated ? RefineWithRejection(problem, std::move(fit), options, &keep)
                                         : IterateRig(std::move(fit), loss, NoiseScale::kOfFit, options);
  if (!settled) return Failure{settled.reason()};
  RigSolution solution = SolutionOf(problem, *settled, keep, options);
  const std::optional<Information> information = RigInformation(*settled, loss);
  if (!information) return HiddenPoint();
  if (const std::optional<Failure> failure = CheckObservable(*information)) return *failure;
  solution.covariance = InvertInformation(*information, 1.0);
  for (size_t c = 0; c < solution.cameras.size(); ++c) {
    const std::string camera_faults = CheckCamera(solution.cameras[c]);
    if (!camera_faults.empty()) {
      return Failure{"the refined camera " + problem.cameras[c].name + " is implausible: " + camera_faults};
    }
  }
  if (const std::optional<Failure> failure =
          CheckDetermined(solution.covariance, ReachesOf(*settled->problem, settled->state))) {
    return *failure;
  }
  return solution;
}

}  // namespace heba
