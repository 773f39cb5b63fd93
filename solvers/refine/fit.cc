#include "solvers/refine/fit.h"

#include <algorithm>
#include <cmath>

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include "heba/base/parallel.h"
#include "heba/geometry/pose_block.h"
#include "solvers/refine/reprojection_problem.h"
#include "solvers/residuals/view_reduction.h"

namespace heba {
namespace {

// Returns 1 / sigma for each camera parameter, or 0 if it is held or nothing is known about it.
Eigen::VectorXd PriorWeights(const CameraPrior& prior, const FreeParameters& free) {
  CHECK_EQ(prior.params.size(), prior.sigmas.size());
  CHECK_LE(prior.params.size(), free.size());
  Eigen::VectorXd weights(static_cast<Eigen::Index>(prior.params.size()));
  for (Eigen::Index i = 0; i < weights.size(); ++i) {
    weights[i] = free[static_cast<size_t>(i)] ? 1 / prior.sigmas[static_cast<size_t>(i)] : 0;
  }
  return weights;
}

// Returns the prior as the rows of a view that do not depend on a correction, scaled to noise of variance
// `row_variance`.
LinearisedView PriorView(const CameraPrior& prior, const Camera& camera, const FreeParameters& free,
                         double row_variance) {
  const Eigen::VectorXd weights = std::sqrt(row_variance) * PriorWeights(prior, free);
  const Eigen::Index num_free = std::count(free.begin(), free.end(), true);
  const Eigen::Index num_rows =
      std::count(free.begin(), free.begin() + static_cast<std::ptrdiff_t>(prior.params.size()), true);
  LinearisedView view;
  view.by_unknowns = Eigen::MatrixXd::Zero(num_rows, 12 + num_free);
  view.by_correction = Eigen::MatrixXd::Zero(num_rows, 6);
  view.offset.resize(num_rows);
  view.num_rows_without_correction = num_rows;
  Eigen::Index row = 0;
  for (size_t i = 0; i < prior.params.size(); ++i) {
    if (!free[i]) continue;
    const double weight = weights[static_cast<Eigen::Index>(i)];
    view.by_unknowns(row, 12 + row) = -weight;
    view.offset[row++] = weight * (camera.params[i] - prior.params[i]);
  }
  return view;
}

// All unknowns in one array. Ceres orders blocks by their addresses; contiguous storage fixes the order of summation,
// so the result is identical to the last digit in every thread.
struct Unknowns {
  std::vector<double> all;  // Hand-eye pose, board pose, camera, then the shape if it is unknown.

  Unknowns(const FitState& state, bool has_shape) {
    const auto append = [&](const auto& block) { all.insert(all.end(), block.begin(), block.end()); };
    append(ToBlock(state.hand_eye.camera_mount_from_camera));
    append(ToBlock(state.hand_eye.target_mount_from_target));
    append(state.camera.params);
    if (has_shape) append(state.shape.params);
  }
  double* hand_eye() { return all.data(); }
  double* board() { return all.data() + 7; }
  double* params() { return all.data() + 14; }
};

// Returns the cost of the problem's captures. Corrections, if there are any, start at those of the state.
std::unique_ptr<CapturesCost> MakeCost(const Problem& problem, const PoseGroups& groups, const FreeParameters& free,
                                       const FitState& state, const std::optional<RobotNoise>& correction_noise,
                                       CapturesCostOptions options) {
  const CameraModel& model = state.camera.Model();
  options.free = free;
  if (HasShape(free, model)) options.shape = state.shape;
  options.has_eliminated_pose = correction_noise.has_value();
  options.eliminated_pose_prior = correction_noise;
  // All corrections are zero before the first solve.
  options.eliminated_poses_are_rough =
      std::all_of(state.corrections.begin(), state.corrections.end(), [](const Rigid3d& correction) {
        return correction.translation.isZero(0) && correction.rotation.vec().isZero(0);
      });
  std::vector<CaptureTerm> captures;
  if (options.has_eliminated_pose) {
    for (const std::vector<size_t>& group : groups) {
      const auto chain_of = [&](size_t i) {
        return MakeCorrectedLoop(problem.setup, problem.views[i].camera_mount_from_target_mount);
      };
      const size_t first = group.front();
      CaptureTerm& term = captures.emplace_back(&problem.views[first].observations, chain_of(first),
                                                state.corrections.empty() ? Rigid3d() : state.corrections[first]);
      for (size_t k = 1; k < group.size(); ++k) {
        term.views.push_back({&problem.views[group[k]].observations, chain_of(group[k])});
      }
    }
  } else {
    for (const View& view : problem.views) {
      captures.emplace_back(&view.observations, MakeHandEyeLoop(view.camera_mount_from_target_mount));
    }
  }
  return std::make_unique<CapturesCost>(model, std::move(captures), std::move(options));
}

// Returns the cached normal equations if they belong to this problem, loss and pixel sigma; otherwise nothing.
std::optional<NormalEquations> ProductsOf(const std::optional<KnownProducts>& known, const SharedProblem& problem,
                                          const Loss& loss, double pixel_px) {
  if (!known || known->problem != problem || known->loss != &loss) return std::nullopt;
  if (known->pixel_px == pixel_px) return known->products;
  if (loss.name != "none") return std::nullopt;
  // Without a robust loss the pixel sigma is only a scale factor.
  NormalEquations products = known->products;
  products.matrix *= known->pixel_px * known->pixel_px / (pixel_px * pixel_px);
  return products;
}

}  // namespace

ViewDistances SquaredDistances(const Problem& problem, const FitState& state, int num_threads) {
  ViewDistances distances(problem.views.size());
  const TargetShape* const shape = state.shape.params == TargetShape().params ? nullptr : &state.shape;
  int num_points = 0;
  for (const View& view : problem.views) num_points += view.observations.size();
  ParallelFor(static_cast<int>(problem.views.size()), ThreadsFor(num_points, num_threads), [&](int index) {
    const auto i = static_cast<size_t>(index);
    const View& view = problem.views[i];
    const Rigid3d camera_from_target =
        CameraFromTarget(problem.setup, state.hand_eye, view.camera_mount_from_target_mount,
                         state.corrections.empty() ? Rigid3d() : state.corrections[i]);
    distances[i] =
        WhitenedSquares(state.camera.Model(), state.camera.params.data(), camera_from_target, view.observations, shape);
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

ViewDistances DistancesAt(const Problem& problem, const FitState& state, int num_threads) {
  ViewDistances distances = SquaredDistances(problem, state, num_threads);
  CHECK(std::all_of(distances.begin(), distances.end(), [](const auto& view) { return view.has_value(); }))
      << "Ceres accepted a step that hides a point";
  return distances;
}

double FitCost(const ViewDistances& squared_distances, const FitState& state, const PoseGroups& groups,
               const FitNoise& noise, const Loss& loss) {
  const double per_px2 = 1 / (noise.pixel_px * noise.pixel_px);
  double sum = 0;
  for (const std::optional<std::vector<double>>& view : squared_distances) {
    for (size_t i = 0; view && i < view->size(); ++i) sum += loss.rho((*view)[i] * per_px2);
  }
  for (const std::vector<size_t>& group : groups) {
    if (state.corrections.empty()) break;
    const Tangent6 tangent = LocalCoordinates(Rigid3d(), state.corrections[group.front()]);
    sum += tangent.head<3>().squaredNorm() / (noise.robot->translation_m * noise.robot->translation_m) +
           tangent.tail<3>().squaredNorm() / (noise.robot->rotation_rad * noise.robot->rotation_rad);
  }
  return 0.5 * sum;
}

std::optional<std::vector<LinearisedView>> LineariseFit(const Problem& problem, const FitState& state,
                                                        const PoseGroups& groups, const FreeParameters& free,
                                                        const FitNoise& noise, const Loss& loss,
                                                        double prior_row_variance,
                                                        const std::optional<CameraPrior>& prior) {
  std::optional<std::vector<LinearisedView>> views =
      LineariseViews({state.camera, problem.views, problem.setup, state.shape}, state.hand_eye, state.corrections, free,
                     noise.pixel_px, loss);
  if (!views) return views;
  views = StackGroups(*views, groups);
  if (prior) views->push_back(PriorView(*prior, state.camera, free, prior_row_variance));
  return views;
}

ceres::Solver::Summary MinimiseOnce(const FreeParameters& free, const Loss& loss, NoiseScale scale,
                                    const BundleOptions& bundle_options, Fit* fit) {
  const Problem& problem = *fit->problem;
  const FitNoise& noise = fit->noise;
  FitState* const state = &fit->state;
  const CameraModel& model = problem.camera.Model();
  const bool has_shape = HasShape(free, model);
  Unknowns unknowns(*state, has_shape);
  double* const hand_eye = unknowns.hand_eye();
  double* const board = unknowns.board();
  double* const params = unknowns.params();
  CapturesCostOptions options;
  options.pixel_sigma_px = noise.pixel_px;
  options.loss = &loss;
  options.num_threads = bundle_options.num_threads;
  const bool has_corrections = !state->corrections.empty();
  if (!has_corrections) options.known = ProductsOf(fit->known, fit->problem, loss, noise.pixel_px);
  const std::unique_ptr<CapturesCost> cost =
      MakeCost(problem, *fit->groups, free, *state, has_corrections ? noise.robot : std::nullopt, options);
  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  std::optional<ceres::NormalPrior> prior_cost;  // The Ceres problem does not own its costs.
  ceres::Problem ceres_problem(problem_options);
  ceres_problem.AddParameterBlock(hand_eye, 7, new PoseManifold);
  ceres_problem.AddParameterBlock(board, 7, new PoseManifold);
  AddCameraBlock(free, params, &ceres_problem);
  ceres_problem.AddResidualBlock(cost.get(), nullptr, hand_eye, board, params);
  ceres::Solver::Options solver_options = ReprojectionSolverOptions(bundle_options.max_iterations);
  constexpr double kRough = 1e-6;
  if (scale == NoiseScale::kMedian) solver_options.function_tolerance = kRough;
  ceres::Solver::Summary summary;
  if (bundle_options.camera_prior) {
    const CameraPrior& prior = *bundle_options.camera_prior;
    const Eigen::VectorXd weights = PriorWeights(prior, free);
    const Eigen::Index size = static_cast<Eigen::Index>(free.size());
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(weights.size(), size);
    rows.leftCols(weights.size()) = weights.asDiagonal();
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(size);
    mean.head(weights.size()) = Eigen::Map<const Eigen::VectorXd>(prior.params.data(), weights.size());
    prior_cost.emplace(rows, mean);
    ceres_problem.AddResidualBlock(&*prior_cost, nullptr, params);
    ceres::Solve(solver_options, &ceres_problem, &summary);
  } else {
    summary = SolveCaptures(*cost, solver_options, &ceres_problem);
  }
  state->hand_eye = {FromBlock(hand_eye), FromBlock(board)};
  state->camera.params.assign(params, params + NumParams(model));
  if (has_shape) std::copy_n(params + NumParams(model), state->shape.params.size(), state->shape.params.begin());
  const std::vector<Rigid3d> corrections = cost->EliminatedPoses();
  for (size_t g = 0; g < corrections.size(); ++g) {
    for (const size_t i : (*fit->groups)[g]) state->corrections[i] = corrections[g];
  }
  if (summary.termination_type == ceres::CONVERGENCE && !has_corrections &&
      cost->Accepted().parameters == unknowns.all) {
    fit->known = KnownProducts{fit->problem, &loss, noise.pixel_px, cost->Accepted()};
    // Identical up to the normalisation of the poses.
    fit->known->products.parameters = Unknowns(*state, has_shape).all;
  }
  return summary;
}

std::optional<Information> FitInformation(const FreeParameters& free, const Loss& loss,
                                          const BundleOptions& bundle_options, Fit* fit) {
  const Problem& problem = *fit->problem;
  const FitState& state = fit->state;
  const FitNoise& noise = fit->noise;
  const CameraModel& model = state.camera.Model();
  // The information of the pixels' rows is 1 / factor of their weighted normal matrix (Loss::covariance_factor).
  const double factor = loss.covariance_factor();
  if (noise.robot) {
    // Marginalised over the corrections. The Schur complement of the normal equations would be equivalent, but
    // cancellation leaves no significant digits if the images are far more exact than the robot.
    const std::optional<std::vector<LinearisedView>> views =
        LineariseFit(problem, state, *fit->groups, free, noise, loss, factor, bundle_options.camera_prior);
    if (!views) return std::nullopt;
    return Information{UnknownNames(model, free), MarginalInformation(*views, *noise.robot, factor)};
  }
  CapturesCostOptions options;
  options.pixel_sigma_px = noise.pixel_px;
  options.loss = &loss;
  options.num_threads = bundle_options.num_threads;
  options.known = ProductsOf(fit->known, fit->problem, loss, noise.pixel_px);
  Unknowns unknowns(state, HasShape(free, model));
  const double* const blocks[] = {unknowns.hand_eye(), unknowns.board(), unknowns.params()};
  std::optional<NormalEquations> products =
      MakeCost(problem, *fit->groups, free, state, std::nullopt, options)->NormalEquationsAt(blocks);
  if (!products) return std::nullopt;
  const Eigen::Index num_unknowns = products->matrix.cols() - 1;
  Information information{UnknownNames(model, free),
                          products->matrix.topLeftCorner(num_unknowns, num_unknowns) / factor};
  fit->known = KnownProducts{fit->problem, &loss, noise.pixel_px, std::move(*products)};
  if (bundle_options.camera_prior) {
    const Eigen::VectorXd weights = PriorWeights(*bundle_options.camera_prior, free);
    Eigen::Index unknown = 12;
    for (Eigen::Index i = 0; i < weights.size(); ++i) {
      if (!free[static_cast<size_t>(i)]) continue;
      information.matrix(unknown, unknown) += weights[i] * weights[i];
      ++unknown;
    }
  }
  return information;
}

}  // namespace heba
