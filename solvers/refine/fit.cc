#include "solvers/refine/fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <ceres/solver.h>

#include "heba/base/parallel.h"
#include "solvers/refine/reprojection_problem.h"
#include "solvers/residuals/view_reduction.h"
#include "solvers/uncertainty/block_prior.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Returns what is known about the camera and about the target's scales. The prior of the scales is there even if no
// scale is free, so that models are compared by the same measurements.
std::vector<BlockPrior> PriorsOfCameraAndTarget(const BundleOptions& options, const FreeUnknowns& free) {
  std::vector<BlockPrior> priors;
  if (options.camera_prior) priors.push_back(PriorOfCamera(*options.camera_prior, free.params, 0));
  if (options.target_scale_sigma) priors.push_back(PriorOfScales(*options.target_scale_sigma, 0));
  return priors;
}

// Returns the loops of the problem's captures, with corrections of the robot poses if there are any.
LoopProblem LoopsOf(const Problem& problem, const PoseGroups& groups, const FreeUnknowns& free, const FitState& state,
                    const std::optional<RobotNoise>& correction_noise) {
  if (!correction_noise) return HandEyeLoops(problem, free);
  return HandEyeLoops(problem, free, groups, state.corrections, *correction_noise);
}

LoopValues ValuesOf(const FitState& state) {
  return HandEyeValues(state.hand_eye, state.camera, state.shape, state.effects);
}

// Returns the parameter blocks of a state, joined.
std::vector<double> ParametersOf(const FitState& state, const FreeUnknowns& free) {
  return JoinedBlocks(ParameterBlocksOf(HandEyeUnknowns(state.camera.Model(), free)), ValuesOf(state));
}

// Returns whether the cached normal equations are those of this fit with corrections, and have lost so few digits in
// their elimination that they give its covariance.
bool HasMarginalProducts(const Fit& fit, const Loss& loss, const FreeUnknowns& free) {
  constexpr double kMostLoss = 1e6;     // The numbers have a precision of 1e-16.
  constexpr double kQuadrature = 1e-6;  // Precision of the factors of a loss.
  if (!fit.known || !fit.known->noise.robot || std::abs(loss.covariance_factor() - 1) > kQuadrature) return false;
  const KnownProducts& known = *fit.known;
  return known.problem == fit.problem && known.loss == &loss && known.noise.pixel_px == fit.noise.pixel_px &&
         known.noise.robot->translation_m == fit.noise.robot->translation_m &&
         known.noise.robot->rotation_rad == fit.noise.robot->rotation_rad &&
         known.noise.robot->joint_rad == fit.noise.robot->joint_rad && known.products.elimination_loss < kMostLoss &&
         known.products.parameters == ParametersOf(fit.state, free);
}

// Adds the information of the effects' standard deviations.
void AddEffectPriors(const FreeUnknowns& free, const FitNoise& noise, Information* information) {
  if (free.effects != nullptr) AddPrior(PriorOfEffects(EffectWeights(free, noise), 0), information);
}

// Adds the information of all priors: of camera, target and effects.
void AddPriors(const BundleOptions& options, const FreeUnknowns& free, const FitNoise& noise,
               Information* information) {
  for (const BlockPrior& prior : PriorsOfCameraAndTarget(options, free)) AddPrior(prior, information);
  AddEffectPriors(free, noise, information);
}

// Returns the cached normal equations if they belong to this problem, loss and pixel sigma; otherwise nothing.
std::optional<NormalEquations> ProductsOf(const std::optional<KnownProducts>& known, const SharedProblem& problem,
                                          const Loss& loss, double pixel_px) {
  if (!known || known->problem != problem || known->loss != &loss || known->noise.robot) return std::nullopt;
  if (known->noise.pixel_px == pixel_px) return known->products;
  if (loss.kind != LossKind::kNone) return std::nullopt;
  // Without a robust loss the pixel sigma is only a scale factor.
  NormalEquations products = known->products;
  products.matrix *= std::pow(known->noise.pixel_px / pixel_px, 2);
  return products;
}

}  // namespace

Eigen::VectorXd EffectWeights(const FreeUnknowns& free, const FitNoise& noise) {
  if (free.effects == nullptr) return {};
  return EffectWeights(*free.effects, noise.effect_sigmas);
}

Eigen::VectorXd EffectWeights(const SharedEffects& effects, const std::vector<double>& sigmas) {
  Eigen::VectorXd weights(effects.size());
  for (Eigen::Index i = 0; i < weights.size(); ++i) {
    weights[i] = 1 / sigmas[effects.effects[static_cast<size_t>(i)].group];
  }
  return weights;
}

Rigid3d PredictedPose(const Problem& problem, const FreeUnknowns& free, const FitState& state, size_t view) {
  Rigid3d correction = state.corrections.empty() ? Rigid3d() : state.corrections[view];
  const std::shared_ptr<const PoseEffect>& effect = problem.views[view].effect;
  if (free.effects != nullptr && effect != nullptr) {
    correction = effect->Evaluate(AllEffects(*free.effects, state.effects), nullptr) * correction;
  }
  return CameraFromTarget(problem.setup, state.hand_eye, problem.views[view].camera_mount_from_target_mount,
                          correction);
}

ViewDistances SquaredDistances(const Problem& problem, const FreeUnknowns& free, const FitState& state,
                               int num_threads) {
  ViewDistances distances(problem.views.size());
  const CameraModel& model = state.camera.Model();
  const TargetShape* const shape = state.shape.params == TargetShape().params ? nullptr : &state.shape;
  int num_points = 0;
  for (const View& view : problem.views) num_points += view.observations.size();
  ParallelFor(static_cast<int>(problem.views.size()), ThreadsFor(num_points, num_threads), [&](int index) {
    const auto i = static_cast<size_t>(index);
    distances[i] = WhitenedSquares(model, state.camera.params.data(), PredictedPose(problem, free, state, i),
                                   problem.views[i].observations, shape);
  });
  return distances;
}

std::vector<double> JoinDistances(const ViewDistances& distances) {
  std::vector<double> joined;
  for (const std::optional<std::vector<double>>& view : distances) {
    if (view) joined.insert(joined.end(), view->begin(), view->end());
  }
  return joined;
}

std::optional<ViewDistances> DistancesAt(const Problem& problem, const FreeUnknowns& free, const FitState& state,
                                         int num_threads) {
  ViewDistances distances = SquaredDistances(problem, free, state, num_threads);
  const bool are_visible =
      std::all_of(distances.begin(), distances.end(), [](const auto& view) { return view.has_value(); });
  return are_visible ? std::optional<ViewDistances>(std::move(distances)) : std::nullopt;
}

Failure HiddenPoint() { return {"the refined estimate leaves a point of the target without an image"}; }

double FitCost(const Problem& problem, const ViewDistances& squared_distances, const FitState& state,
               const PoseGroups& groups, const FreeUnknowns& free, const FitNoise& noise, const Loss& loss) {
  const double per_px2 = 1 / (noise.pixel_px * noise.pixel_px);
  double sum = EffectWeights(free, noise).cwiseProduct(state.effects).squaredNorm();
  for (const std::optional<std::vector<double>>& view : squared_distances) {
    for (size_t i = 0; view && i < view->size(); ++i) sum += loss.rho((*view)[i] * per_px2);
  }
  for (const std::vector<size_t>& group : groups) {
    if (state.corrections.empty()) break;
    const Matrix6 prior = CorrectionPrior(*noise.robot, problem.views[group.front()].gripper_by_joints);
    sum += (prior * LocalCoordinates(Rigid3d(), state.corrections[group.front()])).squaredNorm();
  }
  return 0.5 * sum;
}

std::vector<LinearisedView> PriorViews(const BundleOptions& options, const FreeUnknowns& free, const Camera& camera,
                                       const TargetShape& shape, double row_variance, Eigen::Index num_effects) {
  const UnknownLayout layout = HandEyeUnknowns(camera.Model(), free);
  LoopValues values;
  values.cameras = {camera.params};
  values.targets = {shape};
  std::vector<LinearisedView> views;
  for (const BlockPrior& prior : PriorsOfCameraAndTarget(options, free)) {
    views.push_back(PriorView(prior, layout, values, row_variance, num_effects));
  }
  return views;
}

std::optional<std::vector<LinearisedView>> LineariseFit(const Problem& problem, const FitState& state,
                                                        const PoseGroups& groups, const FreeUnknowns& free,
                                                        const FitNoise& noise, const Loss& loss,
                                                        double prior_row_variance, const BundleOptions& options) {
  // Without corrections the columns of the effects are still needed: their variance may be zero.
  const std::vector<Rigid3d> none(problem.views.size());
  std::optional<std::vector<LinearisedView>> views = LineariseCaptures(
      HandEyeLoops(problem, free, groups, state.corrections.empty() ? none : state.corrections, {1, 1}),
      ValuesOf(state), noise.pixel_px, loss);
  if (!views) return views;
  for (LinearisedView& view :
       PriorViews(options, free, state.camera, state.shape, prior_row_variance, views->front().by_effects.cols())) {
    views->push_back(std::move(view));
  }
  return views;
}

ceres::Solver::Summary MinimiseOnce(const FreeUnknowns& free, const Loss& loss, NoiseScale scale,
                                    const BundleOptions& bundle_options, Fit* fit) {
  const FitNoise& noise = fit->noise;
  FitState* const state = &fit->state;
  CapturesCostOptions options;
  options.pixel_sigma_px = noise.pixel_px;
  options.loss = &loss;
  options.num_threads = bundle_options.num_threads;
  const bool has_corrections = !state->corrections.empty();
  if (!has_corrections) options.known = ProductsOf(fit->known, fit->problem, loss, noise.pixel_px);
  // All corrections are zero before the first solve.
  options.eliminated_poses_are_rough =
      std::all_of(state->corrections.begin(), state->corrections.end(), [](const Rigid3d& correction) {
        return correction.translation.isZero(0) && correction.rotation.vec().isZero(0);
      });
  LoopProblem loops = LoopsOf(*fit->problem, *fit->groups, free, *state, has_corrections ? noise.robot : std::nullopt);
  LoopUnknowns unknowns(loops.layout, ValuesOf(*state));
  CapturesCost cost(std::move(loops), options);
  ceres::Solver::Options solver_options = ReprojectionSolverOptions(bundle_options.max_iterations);
  constexpr double kRough = 1e-6;
  if (scale == NoiseScale::kMedian) solver_options.function_tolerance = kRough;
  std::vector<BlockPrior> priors;
  for (BlockPrior& prior : PriorsOfCameraAndTarget(bundle_options, free)) {
    // Ceres has no block of a shape that is known.
    const bool has_block = prior.owner == UnknownOwner::kCamera || HasShape(free.params, state->camera.Model());
    if (has_block) priors.push_back(std::move(prior));
  }
  if (free.effects != nullptr) {
    priors.push_back(PriorOfEffects(EffectWeights(free, noise), 0));
  }
  ceres::Solver::Summary summary = SolveCaptures(solver_options, &cost, &unknowns, priors);
  const LoopValues values = unknowns.Values();
  state->hand_eye = {values.poses[0], values.poses[1]};
  state->camera.params = values.cameras.front();
  state->shape = values.targets.front();
  if (free.effects != nullptr) state->effects = values.effects.front();
  const std::vector<std::vector<Rigid3d>> corrections = cost.EliminatedPoses();
  for (size_t g = 0; g < corrections.size(); ++g) {
    for (const size_t i : (*fit->groups)[g]) state->corrections[i] = corrections[g].front();
  }
  // After a step that does not improve the cost, the Jacobians that were evaluated last are not those of the solution.
  if (summary.termination_type == ceres::CONVERGENCE && cost.Accepted().parameters == unknowns.all()) {
    fit->known = KnownProducts{
        fit->problem, &loss, {noise.pixel_px, has_corrections ? noise.robot : std::nullopt, {}}, cost.Accepted()};
    // Identical up to the normalisation of the poses.
    fit->known->products.parameters = ParametersOf(*state, free);
  }
  return summary;
}

std::optional<Information> FitInformation(const FreeUnknowns& free, const Loss& loss,
                                          const BundleOptions& bundle_options, Fit* fit) {
  const Problem& problem = *fit->problem;
  const FitState& state = fit->state;
  const FitNoise& noise = fit->noise;
  // The information of the pixels' rows is 1 / factor of their weighted normal matrix (Loss::covariance_factor).
  const double factor = loss.covariance_factor();
  if (noise.robot && HasMarginalProducts(*fit, loss, free)) {
    Information information{HandEyeUnknowns(state.camera.Model(), free), {}};
    const Eigen::Index size = information.layout.size();
    information.matrix = fit->known->products.matrix.topLeftCorner(size, size);
    AddPriors(bundle_options, free, noise, &information);
    return information;
  }
  if (noise.robot) {
    // Marginalised over the corrections. The Schur complement of the normal equations is equivalent, but cancellation
    // leaves no significant digits if the images are far more exact than the robot.
    const std::optional<std::vector<LinearisedView>> views =
        LineariseFit(problem, state, *fit->groups, free, noise, loss, factor, bundle_options);
    if (!views) return std::nullopt;
    Information information{
        HandEyeUnknowns(state.camera.Model(), free),
        MarginalInformation(*views, CorrectionVariances(*noise.robot, views->front().by_effects.cols()), factor)};
    // The views contain the priors of camera and target already.
    AddEffectPriors(free, noise, &information);
    return information;
  }
  CapturesCostOptions options;
  options.pixel_sigma_px = noise.pixel_px;
  options.loss = &loss;
  options.num_threads = bundle_options.num_threads;
  options.known = ProductsOf(fit->known, fit->problem, loss, noise.pixel_px);
  LoopProblem loops = LoopsOf(problem, *fit->groups, free, state, std::nullopt);
  Information information{loops.layout, {}};
  const LoopUnknowns unknowns(loops.layout, ValuesOf(state));
  std::optional<NormalEquations> products =
      CapturesCost(std::move(loops), options).NormalEquationsAt(unknowns.blocks().data());
  if (!products) return std::nullopt;
  const Eigen::Index num_unknowns = information.layout.size();
  information.matrix = products->matrix.topLeftCorner(num_unknowns, num_unknowns) / factor;
  fit->known = KnownProducts{fit->problem, &loss, {noise.pixel_px, std::nullopt, {}}, std::move(*products)};
  AddPriors(bundle_options, free, noise, &information);
  return information;
}

}  // namespace heba
