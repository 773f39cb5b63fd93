#include "solvers/rig/rig_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "heba/base/factorisation.h"
#include "heba/base/parallel.h"
#include "heba/data/free_parameters.h"
#include "solvers/refine/noise_iteration.h"
#include "solvers/refine/reprojection_problem.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/residuals/view_reduction.h"
#include "solvers/uncertainty/block_prior.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// The points of each camera.
std::vector<std::vector<const Observations*>> PointsOfCameras(const RigProblem& problem) {
  std::vector<std::vector<const Observations*>> all(problem.cameras.size());
  for (const RigCapture& capture : problem.captures) {
    for (const RigImage& image : capture.images) all[image.camera].push_back(&image.observations);
  }
  return all;
}

// Returns what is known about the cameras and about the scales of the targets.
std::vector<BlockPrior> PriorsOfCamerasAndTargets(const RigProblem& problem) {
  std::vector<BlockPrior> priors;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const RigCamera& camera = problem.cameras[c];
    if (!camera.prior || camera.free_intrinsics.empty()) continue;
    priors.push_back(PriorOfCamera(*camera.prior, FreeOf(camera.camera.Model(), camera.free_intrinsics), c));
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    const RigTarget& target = problem.targets[t];
    const std::vector<TargetShapeGroup>& free = target.free_shape;
    const bool has_scale = std::find(free.begin(), free.end(), TargetShapeGroup::kScale) != free.end();
    if (target.scale_sigma && has_scale) priors.push_back(PriorOfScales(*target.scale_sigma, t));
  }
  return priors;
}

// Returns all priors: of the arms' effects, the cameras and the targets' scales.
std::vector<BlockPrior> PriorsOf(const RigProblem& problem, const RigNoise& noise) {
  std::vector<BlockPrior> priors;
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr) continue;
    const size_t index = priors.size();
    priors.push_back(PriorOfEffects(EffectWeights(*effects, noise.effect_sigmas[r]), index));
  }
  for (BlockPrior& prior : PriorsOfCamerasAndTargets(problem)) priors.push_back(std::move(prior));
  return priors;
}

ceres::Solver::Summary MinimiseRigOnce(const Loss& loss, NoiseScale scale, const RigOptions& rig_options, RigFit* fit) {
  CapturesCostOptions options;
  options.loss = &loss;
  options.num_threads = rig_options.num_threads;
  const auto is_zero = [](const Rigid3d& correction) {
    return correction.translation.isZero(0) && correction.rotation.vec().isZero(0);
  };
  // All corrections are zero before the first solve.
  options.eliminated_poses_are_rough =
      std::all_of(fit->state.corrections.begin(), fit->state.corrections.end(),
                  [&](const auto& of_capture) { return std::all_of(of_capture.begin(), of_capture.end(), is_zero); });
  LoopProblem loops = RigLoops(*fit->problem, fit->groups, fit->state, fit->noise);
  LoopUnknowns unknowns(loops.layout, RigValues(fit->state));
  CapturesCost cost(std::move(loops), options);
  ceres::Solver::Options solver_options = ReprojectionSolverOptions(rig_options.max_iterations);
  constexpr double kRough = 1e-6;
  if (scale == NoiseScale::kMedian) solver_options.function_tolerance = kRough;
  ceres::Solver::Summary summary = SolveCaptures(solver_options, &cost, &unknowns, PriorsOf(*fit->problem, fit->noise));
  fit->state = WithValues(std::move(fit->state), unknowns.Values());
  const std::vector<size_t> moving = MovingRobots(*fit->problem);
  const std::vector<std::vector<Rigid3d>> corrections = cost.EliminatedPoses();
  for (size_t g = 0; g < corrections.size(); ++g) {
    for (size_t k = 0; k < corrections[g].size(); ++k) {
      for (const size_t i : fit->groups[g]) fit->state.corrections[i][moving[k]] = corrections[g][k];
    }
  }
  return summary;
}

// Returns the joined distances of each camera's points.
std::vector<std::vector<double>> DistancesOfCameras(const RigFit& fit, int num_threads) {
  std::vector<std::vector<double>> of_cameras(fit.problem->cameras.size());
  const ViewDistances distances = ImageDistances(*fit.problem, fit.groups, fit.state, num_threads);
  const std::vector<ImageIndex> images = ImagesOf(*fit.problem, fit.groups);
  for (size_t v = 0; v < images.size(); ++v) {
    if (!distances[v]) continue;
    const size_t camera = fit.problem->captures[images[v].capture].images[images[v].image].camera;
    of_cameras[camera].insert(of_cameras[camera].end(), distances[v]->begin(), distances[v]->end());
  }
  return of_cameras;
}

// Estimates the two sigmas of each camera from its residuals and their redundancy: that of the points from the part
// that no other pose of the target explains, that of the images from the part that one does.
void EstimateCameraNoise(const RigFit& fit, const LinearisedImages& images, const Eigen::MatrixXd& covariance,
                         RigNoise* noise) {
  const Eigen::VectorXd variances = CorrectionVariances(fit.noise, MovingRobots(*fit.problem).size());
  // The sums of squares and the redundancies of both parts, and the redundancy of the pose part times points.
  struct Sums {
    double rest = 0;
    double rest_dof = 0;
    double pose = 0;
    double pose_dof = 0;
    double pose_dof_points = 0;
  };
  std::vector<Sums> of_cameras(noise->pixel_px.size());
  for (const std::vector<size_t>& group : images.groups) {
    std::vector<const LinearisedView*> views;
    for (const size_t v : group) views.push_back(&images.views[v]);
    const CorrectionPosterior posterior = PosteriorOf(views, variances, covariance.rows());
    const Eigen::VectorXd corrections =
        CorrectionTangents(fit.state, images.images[group.front()].capture, MovingRobots(*fit.problem));
    for (const size_t v : group) {
      const LinearisedView& view = images.views[v];
      const ImageIndex& index = images.images[v];
      const RigImage& image = fit.problem->captures[index.capture].images[index.image];
      if (view.offset.size() <= 6) continue;
      const Eigen::MatrixXd basis = PosePartOf(*fit.problem, image, view);
      const Eigen::VectorXd residual = ResidualOf(*fit.problem, fit.state, view, corrections);
      const Eigen::MatrixXd predicted = PredictionCovariance(view, posterior, covariance);
      const double pose = (basis.transpose() * residual).squaredNorm();
      const double pose_leverage = (basis.transpose() * predicted * basis).trace();
      const double ratio = PoseVarianceRatio(fit.noise, image);
      Sums& sums = of_cameras[image.camera];
      sums.rest += residual.squaredNorm() - pose + view.residual_sum_of_squares;
      sums.rest_dof +=
          static_cast<double>(view.offset.size() - 6 + view.num_residual_dof) - (predicted.trace() - pose_leverage);
      sums.pose += ratio * pose;
      sums.pose_dof += 6 - pose_leverage;
      sums.pose_dof_points += (6 - pose_leverage) * image.observations.size();
    }
  }
  for (size_t c = 0; c < of_cameras.size(); ++c) {
    const Sums& sums = of_cameras[c];
    if (!(sums.rest_dof > 1)) continue;
    const double old_px2 = noise->pixel_px[c] * noise->pixel_px[c];
    const double pixel_px2 = std::max(kMinSigmaPx * kMinSigmaPx, old_px2 * sums.rest / sums.rest_dof);
    noise->pixel_px[c] = std::sqrt(pixel_px2);
    // Few images do not tell the error of an image from that of an arm.
    constexpr double kLeastDof = 6;
    if (sums.pose_dof < kLeastDof) continue;
    const double image_px2 = 3 * (old_px2 * sums.pose - pixel_px2 * sums.pose_dof) / sums.pose_dof_points;
    noise->image_px[c] = std::sqrt(std::max(0.0, image_px2));
  }
}

struct EstimatedRigNoise {
  RigNoise noise;
  std::vector<RobotNoise> robot_stddev;
  double dof = 0;
};

// Estimates the noise that explains the residuals best.
std::optional<EstimatedRigNoise> EstimateNoise(const RigFit& fit, const Loss& loss, NoiseScale scale,
                                               const RigOptions& options) {
  EstimatedRigNoise result;
  result.noise = fit.noise;
  const std::optional<LinearisedImages> images = LineariseImages(*fit.problem, fit.groups, fit.state, fit.noise, loss);
  if (!images) return std::nullopt;
  const std::optional<Information> information = RigInformation(fit, loss);
  if (!information) return std::nullopt;
  const Eigen::MatrixXd covariance = InvertInformation(*information, 1.0).matrix;
  if (!options.pixel_noise_px && scale == NoiseScale::kOfFit) {
    EstimateCameraNoise(fit, *images, covariance, &result.noise);
  } else if (!options.pixel_noise_px) {
    const std::vector<std::vector<double>> distances = DistancesOfCameras(fit, options.num_threads);
    for (size_t c = 0; c < distances.size(); ++c) result.noise.pixel_px[c] = SigmaFromMedian(distances[c]);
  }
  std::vector<LinearisedView> captures = StackGroups(images->views, images->groups);
  for (LinearisedView& view :
       PriorViews(*fit.problem, fit.state, loss.consistency, captures.front().by_effects.cols())) {
    captures.push_back(std::move(view));
  }
  const bool robots_are_free = options.robot == BundleOptions::Robot::kEstimatedNoise;
  const std::vector<VarianceGroup> groups = RigVarianceGroups(
      *fit.problem, fit.noise, loss.consistency, !options.pixel_noise_px, robots_are_free, options.robot_noise_prior);
  const VarianceComponents found = EstimateVariances(captures, groups);
  for (size_t k = 0; k < fit.noise.robots.size(); ++k) {
    const auto translation = static_cast<Eigen::Index>(1 + 2 * k);
    const RobotNoise robot =
        AtLeastExact({std::sqrt(found.variances[translation]), std::sqrt(found.variances[translation + 1]), 0});
    // Converts the standard deviation of a variance to that of a sigma.
    result.robot_stddev.push_back({0.5 * found.stddev[translation] / robot.translation_m,
                                   0.5 * found.stddev[translation + 1] / robot.rotation_rad, 0});
    if (robots_are_free) result.noise.robots[k] = robot;
  }
  auto group = static_cast<Eigen::Index>(1 + 2 * fit.noise.robots.size());
  for (std::vector<double>& sigmas : result.noise.effect_sigmas) {
    for (double& sigma : sigmas) {
      sigma = std::max(kExactEffect, std::sqrt(found.variances[group]));
      ++group;
    }
  }
  result.dof = DegreesOfFreedom(captures, groups, found);
  return result;
}

bool NoiseConverged(const RigNoise& noise, const RigNoise& next, NoiseScale scale) {
  const double robot_tolerance = scale == NoiseScale::kMedian ? 0.02 : 1e-3;
  const double pixel_tolerance = scale == NoiseScale::kMedian ? 0.02 : 1e-4;
  const RobotNoise exact = AtLeastExact({0, 0, 0});
  const auto is_close = [&](double a, double b, double exact_sigma) {
    return std::abs(a - b) < robot_tolerance * std::max(a, b) || std::max(a, b) <= 2 * exact_sigma;
  };
  for (size_t c = 0; c < noise.pixel_px.size(); ++c) {
    if (std::abs(next.pixel_px[c] - noise.pixel_px[c]) >= pixel_tolerance * noise.pixel_px[c]) return false;
    // An error of an image that is far below that of its points does not matter.
    if (std::abs(next.image_px[c] - noise.image_px[c]) >=
        robot_tolerance * std::hypot(noise.pixel_px[c], noise.image_px[c])) {
      return false;
    }
  }
  for (size_t k = 0; k < noise.robots.size(); ++k) {
    if (!is_close(noise.robots[k].translation_m, next.robots[k].translation_m, exact.translation_m)) return false;
    if (!is_close(noise.robots[k].rotation_rad, next.robots[k].rotation_rad, exact.rotation_rad)) return false;
  }
  for (size_t r = 0; r < noise.effect_sigmas.size(); ++r) {
    for (size_t g = 0; g < noise.effect_sigmas[r].size(); ++g) {
      if (!is_close(noise.effect_sigmas[r][g], next.effect_sigmas[r][g], kExactEffect)) return false;
    }
  }
  return true;
}

// Updates the unmodelled part of each camera's noise and the weights that follow from it. Returns whether they changed.
bool UpdateWeights(RigFit* fit) {
  const std::vector<std::vector<const Observations*>> points = PointsOfCameras(*fit->problem);
  bool has_changed = false;
  for (size_t c = 0; c < points.size(); ++c) {
    const double detector_px = TypicalDetectorSigma(points[c]).value_or(0);
    if (detector_px == 0) continue;
    const double next_px = UnmodelledSigmaPx(fit->noise.pixel_px[c], detector_px);
    std::optional<double>& current_px = fit->unmodelled_sigma_px[c];
    if (current_px && std::abs(next_px - *current_px) <= 0.02 * std::hypot(next_px, detector_px)) continue;
    current_px = next_px;
    has_changed = true;
  }
  if (has_changed)
    fit->problem = std::make_shared<const RigProblem>(WeightPoints(*fit->problem, fit->unmodelled_sigma_px));
  return has_changed;
}

}  // namespace

RigProblem WeightPoints(RigProblem problem, const std::vector<std::optional<double>>& unmodelled_sigma_px) {
  std::vector<std::vector<Observations*>> of_cameras(problem.cameras.size());
  for (RigCapture& capture : problem.captures) {
    for (RigImage& image : capture.images) of_cameras[image.camera].push_back(&image.observations);
  }
  for (size_t c = 0; c < of_cameras.size(); ++c) {
    if (unmodelled_sigma_px[c]) WeightByCovariance(*unmodelled_sigma_px[c], of_cameras[c]);
  }
  return problem;
}

void AddEffects(const RigProblem& problem, RigState* state, RigNoise* noise) {
  if (problem.effects.empty()) return;
  state->effects.resize(problem.robots.size());
  noise->effect_sigmas.resize(problem.robots.size());
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr || state->effects[r].size() > 0) continue;
    state->effects[r].setZero(effects->size());
    for (const EffectGroup& group : effects->groups) noise->effect_sigmas[r].push_back(group.sigma);
  }
}

std::optional<LinearisedImages> LineariseImages(const RigProblem& problem, const CaptureGroups& groups,
                                                const RigState& state, const RigNoise& noise, const Loss& loss) {
  LinearisedImages result;
  std::optional<std::vector<LinearisedView>> views =
      LineariseCaptures(RigImageLoops(problem, groups, state, noise, MovingRobots(problem)), RigValues(state), 1, loss);
  if (!views) return std::nullopt;
  result.views = std::move(*views);
  result.images = ImagesOf(problem, groups);
  size_t next = 0;
  for (const std::vector<size_t>& group : groups) {
    std::vector<size_t>& of_group = result.groups.emplace_back();
    while (next < result.images.size() &&
           std::find(group.begin(), group.end(), result.images[next].capture) != group.end()) {
      of_group.push_back(next++);
    }
  }
  return result;
}

std::vector<LinearisedView> PriorViews(const RigProblem& problem, const RigState& state, double row_variance,
                                       Eigen::Index num_effects) {
  const UnknownLayout layout = RigUnknowns(problem);
  const LoopValues values = RigValues(state);
  std::vector<LinearisedView> views;
  for (const BlockPrior& prior : PriorsOfCamerasAndTargets(problem)) {
    views.push_back(PriorView(prior, layout, values, row_variance, num_effects));
  }
  return views;
}

Eigen::VectorXd CorrectionVariances(const RigNoise& noise, size_t num_moving) {
  Eigen::VectorXd variances = Eigen::VectorXd::Zero(6 * static_cast<Eigen::Index>(num_moving));
  for (size_t k = 0; k < noise.robots.size(); ++k) {
    variances.segment<6>(6 * static_cast<Eigen::Index>(k)) = CorrectionVariances(noise.robots[k]);
  }
  return variances;
}

ViewDistances ImageDistances(const RigProblem& problem, const CaptureGroups& groups, const RigState& state,
                             int num_threads) {
  const std::vector<ImageIndex> images = ImagesOf(problem, groups);
  int num_points = 0;
  const auto image_of = [&](const ImageIndex& index) -> const RigImage& {
    return problem.captures[index.capture].images[index.image];
  };
  for (const ImageIndex& index : images) num_points += image_of(index).observations.size();
  ViewDistances distances(images.size());
  ParallelFor(static_cast<int>(images.size()), ThreadsFor(num_points, num_threads), [&](int index) {
    const auto v = static_cast<size_t>(index);
    const RigImage& image = image_of(images[v]);
    const Camera& camera = state.cameras[image.camera];
    const TargetShape& shape = state.shapes[image.target];
    distances[v] = WhitenedSquares(camera.Model(), camera.params.data(), PredictedPose(problem, state, images[v]),
                                   image.observations, shape.params == TargetShape().params ? nullptr : &shape);
  });
  return distances;
}

Eigen::MatrixXd PosePartOf(const RigProblem& problem, const RigImage& image, const LinearisedView& view) {
  // Another pose of the camera is another pose of the target.
  const UnknownBlock pose = RigUnknowns(problem).Block(CameraPoseBlock(problem.cameras[image.camera]));
  return HouseholderFactor(view.by_unknowns.middleCols(pose.first, pose.size)).Basis();
}

Eigen::VectorXd CorrectionTangents(const RigState& state, size_t capture, const std::vector<size_t>& moving) {
  Eigen::VectorXd tangents = Eigen::VectorXd::Zero(6 * static_cast<Eigen::Index>(moving.size()));
  for (size_t k = 0; k < moving.size() && !state.corrections.empty(); ++k) {
    tangents.segment<6>(6 * static_cast<Eigen::Index>(k)) =
        LocalCoordinates(Rigid3d(), state.corrections[capture][moving[k]]);
  }
  return tangents;
}

Eigen::VectorXd ResidualOf(const RigProblem& problem, const RigState& state, const LinearisedView& view,
                           const Eigen::VectorXd& corrections) {
  Eigen::VectorXd residual = view.offset - view.by_effects * corrections;
  if (state.effects.empty()) return residual;
  const UnknownLayout layout = RigUnknowns(problem);
  for (size_t r = 0; r < state.effects.size(); ++r) {
    if (EffectsOf(problem, r) == nullptr) continue;
    const UnknownBlock block = layout.Block(ErrorsBlock(problem.robots[r]));
    residual -= view.by_unknowns.middleCols(block.first, block.size) * state.effects[r];
  }
  return residual;
}

std::vector<VarianceGroup> RigVarianceGroups(const RigProblem& problem, const RigNoise& noise, double pixel_variance,
                                             bool pixel_is_free, bool robots_are_free,
                                             const std::optional<RobotNoisePrior>& robot_prior) {
  std::vector<VarianceGroup> groups = {{VarianceGroup::Kind::kPixels, {}, pixel_variance, pixel_is_free}};
  for (size_t k = 0; k < noise.robots.size(); ++k) {
    for (const VarianceGroup& of_robot :
         CorrectionGroups(1, noise.robots[k], false, robots_are_free, robot_prior ? &*robot_prior : nullptr)) {
      if (of_robot.kind == VarianceGroup::Kind::kPixels) continue;
      groups.push_back(of_robot);
      for (Eigen::Index& column : groups.back().columns) column += 6 * static_cast<Eigen::Index>(k);
    }
  }
  const UnknownLayout layout = RigUnknowns(problem);
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr) continue;
    groups = WithEffectGroups(std::move(groups), layout.Block(ErrorsBlock(problem.robots[r])), effects,
                              noise.effect_sigmas[r], robots_are_free, true);
  }
  return groups;
}

CorrectionPosterior PosteriorOf(const std::vector<const LinearisedView*>& views, const Eigen::VectorXd& variances,
                                Eigen::Index num_unknowns) {
  const Eigen::Index size = variances.size();
  // In units of the prior's sigmas, because a variance may be zero.
  const Eigen::VectorXd sigmas = variances.cwiseSqrt();
  Eigen::MatrixXd normal = Eigen::MatrixXd::Identity(size, size);
  Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(size, num_unknowns);
  for (const LinearisedView* const view : views) {
    const Eigen::MatrixXd by_sigmas = view->by_effects * sigmas.asDiagonal();
    normal += by_sigmas.transpose() * by_sigmas;
    mixed += by_sigmas.transpose() * view->by_unknowns;
  }
  const auto factor = Cholesky(normal);  // At least the identity.
  CHECK(factor.has_value());
  CorrectionPosterior posterior;
  posterior.inverse_normal = sigmas.asDiagonal() * factor->Inverse() * sigmas.asDiagonal();
  posterior.by_unknowns = sigmas.asDiagonal() * factor->Solve(mixed);
  return posterior;
}

Eigen::MatrixXd PredictionCovariance(const LinearisedView& view, const CorrectionPosterior& posterior,
                                     const Eigen::MatrixXd& covariance) {
  const Eigen::MatrixXd by_unknowns = view.by_unknowns - view.by_effects * posterior.by_unknowns;
  return by_unknowns * covariance * by_unknowns.transpose() +
         view.by_effects * posterior.inverse_normal * view.by_effects.transpose();
}

std::optional<Information> RigInformation(const RigFit& fit, const Loss& loss) {
  const std::optional<LinearisedImages> images = LineariseImages(*fit.problem, fit.groups, fit.state, fit.noise, loss);
  if (!images) return std::nullopt;
  // The information of the pixels' rows is 1 / factor of their weighted normal matrix (Loss::covariance_factor).
  Information information{
      RigUnknowns(*fit.problem),
      MarginalInformation(StackGroups(images->views, images->groups),
                          CorrectionVariances(fit.noise, MovingRobots(*fit.problem).size()), loss.covariance_factor())};
  for (const BlockPrior& prior : PriorsOf(*fit.problem, fit.noise)) AddPrior(prior, &information);
  return information;
}

Outcome<RigFit> IterateRig(RigFit fit, const Loss& loss, NoiseScale scale, const RigOptions& options) {
  if (std::any_of(fit.unmodelled_sigma_px.begin(), fit.unmodelled_sigma_px.end(),
                  [](const auto& sigma_px) { return sigma_px.has_value(); })) {
    fit.problem = std::make_shared<const RigProblem>(WeightPoints(*fit.problem, fit.unmodelled_sigma_px));
  }
  constexpr int kMaxRounds = 30;
  for (int round = 0; round < kMaxRounds; ++round) {
    const ceres::Solver::Summary summary = MinimiseRigOnce(loss, scale, options, &fit);
    if (round == 0 && fit.convergence.iterations == 0) fit.convergence.initial_cost = summary.initial_cost;
    fit.convergence.final_cost = summary.final_cost;
    fit.convergence.converged = summary.termination_type == ceres::CONVERGENCE;
    fit.convergence.iterations += static_cast<int>(summary.iterations.size()) - 1;
    fit.convergence.seconds += summary.total_time_in_seconds;
    fit.convergence.message = summary.message;
    if (!fit.convergence.converged) {
      // The usual reason is missing information; the failure then names it.
      const std::optional<Information> weak = RigInformation(fit, loss);
      const std::optional<Failure> failure = weak ? CheckObservable(*weak) : std::nullopt;
      return failure.value_or(Failure{"the refinement did not converge: " + summary.message});
    }
    if (options.pixel_noise_px && options.robot != BundleOptions::Robot::kEstimatedNoise) break;
    std::optional<EstimatedRigNoise> next = EstimateNoise(fit, loss, scale, options);
    if (!next) return HiddenPoint();
    bool has_converged = NoiseConverged(fit.noise, next->noise, scale);
    fit.noise = std::move(next->noise);
    fit.robot_stddev = std::move(next->robot_stddev);
    fit.dof = next->dof;
    if (!options.pixel_noise_px && UpdateWeights(&fit)) has_converged = false;
    if (has_converged) break;
  }
  return fit;
}

}  // namespace heba
