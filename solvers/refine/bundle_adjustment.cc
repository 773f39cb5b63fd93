#include "solvers/refine/bundle_adjustment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/geometry/pose_block.h"
#include "solvers/closed_form/motion_analysis.h"
#include "solvers/refine/captures_cost.h"
#include "solvers/refine/reprojection_problem.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/residuals/view_reduction.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/repeated_poses.h"
#include "solvers/uncertainty/robot_noise.h"
#include "solvers/uncertainty/variance_components.h"

namespace heba {
namespace {

// An estimate of all unknowns.
struct State {
  HandEye hand_eye;
  Camera camera;
  TargetShape shape;
  // The correction of each view's robot pose, identical for views at one pose; empty if the robot is exact.
  std::vector<Rigid3d> corrections;
};

// The squared whitened distances of each view's points; nothing if any of its points cannot be projected.
using ViewDistances = std::vector<std::optional<std::vector<double>>>;
ViewDistances SquaredDistances(const Problem& problem, const State& state, int num_threads) {
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

// Returns the distances of all points in the order of the views, skipping views that have none.
std::vector<double> Joined(const ViewDistances& distances) {
  std::vector<double> joined;
  for (const std::optional<std::vector<double>>& view : distances) {
    if (view) joined.insert(joined.end(), view->begin(), view->end());
  }
  return joined;
}

// Returns the distances at a state where every point can be projected, as after a refinement.
ViewDistances DistancesAt(const Problem& problem, const State& state, int num_threads) {
  ViewDistances distances = SquaredDistances(problem, state, num_threads);
  CHECK(std::all_of(distances.begin(), distances.end(), [](const auto& view) { return view.has_value(); }))
      << "Ceres accepted a step that hides a point";
  return distances;
}

// The noise that residuals are whitened with.
struct Noise {
  double pixel_px = 0;
  std::optional<RobotNoise> robot;
};

// Returns half the sum of rho over all points and of the squared whitened corrections.
double Cost(const ViewDistances& squared_distances, const State& state, const PoseGroups& groups, const Noise& noise,
            const Loss& loss) {
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

// Linearises all observations: the captures, with one view per robot pose, and the prior if there is one.
std::optional<std::vector<LinearisedView>> Linearise(const Problem& problem, const State& state,
                                                     const PoseGroups& groups, const FreeParameters& free,
                                                     const Noise& noise, const Loss& loss, double prior_row_variance,
                                                     const std::optional<CameraPrior>& prior) {
  std::optional<std::vector<LinearisedView>> views =
      LineariseViews({state.camera, problem.views, problem.setup, state.shape}, state.hand_eye, state.corrections, free,
                     noise.pixel_px, loss);
  if (!views) return views;
  views = StackGroups(*views, groups);
  if (prior) views->push_back(PriorView(*prior, state.camera, free, prior_row_variance));
  return views;
}

// All unknowns in one array. Ceres orders blocks by their addresses; contiguous storage fixes the order of summation,
// so the result is identical to the last digit in every thread.
struct Unknowns {
  std::vector<double> all;  // Hand-eye pose, board pose, camera, then the shape if it is unknown.

  Unknowns(const State& state, bool has_shape) {
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
                                       const State& state, const std::optional<RobotNoise>& correction_noise,
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
        return MakeCorrectedChain(problem.setup, problem.views[i].camera_mount_from_target_mount);
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
      captures.emplace_back(&view.observations, MakeHandEyeChain(view.camera_mount_from_target_mount));
    }
  }
  return std::make_unique<CapturesCost>(model, std::move(captures), std::move(options));
}

// Problems are large: they are shared, and copied only to be modified.
using SharedProblem = std::shared_ptr<const Problem>;

// Wraps a problem that the caller owns.
SharedProblem Borrowed(const Problem& problem) { return {SharedProblem(), &problem}; }

// Cached normal equations of the captures, with the problem, loss and pixel sigma for which they were computed.
struct KnownProducts {
  SharedProblem problem;
  const Loss* loss;
  double pixel_px;
  NormalEquations products;
};

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

// An estimate in progress.
struct Fit {
  SharedProblem problem;                     // The points in use, with their weights.
  std::shared_ptr<const PoseGroups> groups;  // The problem's views, grouped by robot pose.
  State state;
  Noise noise;
  RobotNoise robot_stddev;
  double dof = std::numeric_limits<double>::infinity();  // See Solution::covariance_dof.
  // The part of the points' sigma that is not in the detectors' covariances. It is equal for all points and estimated
  // from the residuals. Nothing: all points are weighted equally.
  std::optional<double> unmodelled_sigma_px;
  Convergence convergence;
  std::optional<KnownProducts> known;
};

// Selects how sigma is estimated: from the RMS of the fit, or from the median, which is robust to 50 % outliers. The
// median is used while inliers are searched for; that fit need not converge to the last digits.
enum class Scale { kOfFit, kMedian };

// Runs Ceres once with the noise held constant.
ceres::Solver::Summary Minimise(const FreeParameters& free, const Loss& loss, Scale scale,
                                const BundleOptions& bundle_options, Fit* fit) {
  const Problem& problem = *fit->problem;
  const Noise& noise = fit->noise;
  State* const state = &fit->state;
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
  if (scale == Scale::kMedian) solver_options.function_tolerance = kRough;
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

// A robot with smaller sigmas counts as exact: the prior then holds its corrections regardless of the images.
constexpr double kExactM = 1e-8;
constexpr double kExactRad = 1e-8;

RobotNoise AtLeastExact(const RobotNoise& noise) {
  return {std::max(noise.translation_m, kExactM), std::max(noise.rotation_rad, kExactRad)};
}

struct EstimatedNoise {
  Noise noise;
  RobotNoise robot_stddev;
  double dof = 0;  // Degrees of freedom of the unknowns' covariance.
};

// Estimates the noise that explains the residuals best.
EstimatedNoise EstimateNoise(const Fit& fit, const FreeParameters& free, const Loss& loss,
                             const BundleOptions& options) {
  const Noise& noise = fit.noise;
  const bool pixel_is_free = !options.pixel_noise_px;
  const bool robot_is_free = options.robot == BundleOptions::Robot::kEstimatedNoise;
  const std::optional<std::vector<LinearisedView>> views =
      Linearise(*fit.problem, fit.state, *fit.groups, free, noise, loss, loss.consistency, options.camera_prior);
  CHECK(views.has_value()) << "Ceres accepted a step that hides a point";
  VarianceComponents start;
  start.pixel = loss.consistency;
  start.translation_m2 = noise.robot->translation_m * noise.robot->translation_m;
  start.rotation_rad2 = noise.robot->rotation_rad * noise.robot->rotation_rad;
  const VarianceComponents found = EstimateVariances(*views, start, pixel_is_free, robot_is_free, kExactVariances,
                                                     options.robot_noise_prior ? &*options.robot_noise_prior : nullptr);
  EstimatedNoise result;
  result.noise.pixel_px = std::max(kMinSigmaPx, noise.pixel_px * std::sqrt(found.pixel / loss.consistency));
  result.noise.robot = AtLeastExact({std::sqrt(found.translation_m2), std::sqrt(found.rotation_rad2)});
  // Converts the standard deviation of a variance to that of a sigma.
  result.robot_stddev = {0.5 * found.stddev[1] / result.noise.robot->translation_m,
                         0.5 * found.stddev[2] / result.noise.robot->rotation_rad};
  result.dof = DegreesOfFreedom(*views, found);
  return result;
}

// Returns the unknowns' normal matrix at the noise of the fit, or nothing if a point cannot be projected.
std::optional<Information> InformationAt(const FreeParameters& free, const Loss& loss,
                                         const BundleOptions& bundle_options, Fit* fit) {
  const Problem& problem = *fit->problem;
  const State& state = fit->state;
  const Noise& noise = fit->noise;
  const CameraModel& model = state.camera.Model();
  // The information of the pixels' rows is 1 / factor of their weighted normal matrix (Loss::covariance_factor).
  const double factor = loss.covariance_factor();
  if (noise.robot) {
    // Marginalised over the corrections. The Schur complement of the normal equations would be equivalent, but
    // cancellation leaves no significant digits if the images are far more exact than the robot.
    const std::optional<std::vector<LinearisedView>> views =
        Linearise(problem, state, *fit->groups, free, noise, loss, factor, bundle_options.camera_prior);
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

// Returns the part of a typical point's sigma that its detector does not know; at least the error of print and paper.
double UnmodelledSigmaPx(double pixel_sigma_px, double detector_px) {
  constexpr double kLeastPx = 0.005;
  return std::sqrt(std::max(kLeastPx * kLeastPx, pixel_sigma_px * pixel_sigma_px - detector_px * detector_px));
}

// Returns whether another round would change nothing of relevance: robot noise is known to a few per cent at best. A
// robot sigma near the lower bound counts as converged.
bool NoiseConverged(const Noise& noise, const Noise& next, Scale scale) {
  constexpr double kRough = 0.02;
  const double robot_tolerance = scale == Scale::kMedian ? kRough : 1e-3;
  const auto is_close = [&](double a, double b, double exact) {
    return std::abs(a - b) < robot_tolerance * std::max(a, b) || std::max(a, b) <= 2 * exact;
  };
  const double pixel_tolerance = scale == Scale::kMedian ? kRough : next.robot ? 1e-4 : 1e-6;
  if (std::abs(next.pixel_px - noise.pixel_px) >= pixel_tolerance * noise.pixel_px) return false;
  return !next.robot || (is_close(noise.robot->translation_m, next.robot->translation_m, kExactM) &&
                         is_close(noise.robot->rotation_rad, next.robot->rotation_rad, kExactRad));
}

// Returns a Failure if the sigma of an unknown is too large for the result to be useful.
std::optional<Failure> CheckUncertainty(const Covariance& covariance, const Camera& camera) {
  constexpr double kMaxTranslationM = 0.1;
  constexpr double kMaxRotationRad = 0.1;
  constexpr double kMaxFocalRatio = 0.01;
  constexpr double kMaxCentreRatio = 0.02;  // Relative to the image width.
  constexpr double kMaxScale = 0.01;
  constexpr double kMaxBendM = 5e-3;
  for (size_t i = 0; i < covariance.names.size(); ++i) {
    const std::string& name = covariance.names[i];
    const double sigma = std::sqrt(covariance.matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)));
    const std::string part = name.substr(name.find('.') + 1);
    const bool is_pose = !name.starts_with("camera.") && !name.starts_with("target.");
    if (is_pose && part[0] == 't' && !(sigma < kMaxTranslationM)) {
      return Failure{PlainName(name) + " is known to " + Significant(1000 * sigma, 2) +
                     " mm only; more captures with larger turns about different axes are needed"};
    }
    if (is_pose && part[0] == 'r' && !(sigma < kMaxRotationRad)) {
      return Failure{PlainName(name) + " is known to " + Significant(RadToDeg(sigma), 2) +
                     " deg only; more captures with larger turns about different axes are needed"};
    }
    if (part == "fx" || part == "fy") {
      const double focal = camera.params[part == "fx" ? 0 : 1];
      if (!(sigma < kMaxFocalRatio * focal)) {
        return Failure{
            PlainName(name) + " is known to " + Significant(sigma, 2) +
            " px only: the captures cannot tell focal length from distance; move the target through more depth "
            "and tilt, or hold it with a camera file and refine.intrinsics"};
      }
    }
    if (part.starts_with("scale_") && !(sigma < kMaxScale)) {
      return Failure{
          PlainName(name) + " is known to " + Significant(100 * sigma, 2) +
          " % only: the captures cannot tell it from distance; move the target through more depth, or measure "
          "the print and leave refine.target_shape out"};
    }
    if (part.starts_with("bend_") && !(sigma < kMaxBendM)) {
      return Failure{PlainName(name) + " is known to " + Significant(1000 * sigma, 2) +
                     " mm only; tilt the target more, or leave it out of refine.target_shape"};
    }
    if ((part == "cx" || part == "cy") && !(sigma < kMaxCentreRatio * camera.width_px)) {
      return Failure{
          PlainName(name) + " is known to " + Significant(sigma, 2) +
          " px only: the captures cannot tell it from the camera's pointing; tilt the target more, or hold it "
          "with a camera file and refine.intrinsics"};
    }
  }
  return std::nullopt;
}

// Returns a copy of the problem, whitened with the detectors' covariances and the unmodelled sigma.
SharedProblem WeightedByCovariance(const Problem& problem, double unmodelled_sigma_px) {
  auto weighted = std::make_shared<Problem>(problem);
  WeightByCovariance(unmodelled_sigma_px, &weighted->views);
  return weighted;
}

// The estimate and the noise that it is whitened with depend on each other: alternates between both until they
// converge.
Outcome<Fit> IterateNoiseAndFit(Fit fit, const FreeParameters& free, const Loss& loss, Scale scale,
                                const BundleOptions& options) {
  const int num_unknowns = 12 + static_cast<int>(std::count(free.begin(), free.end(), true));
  const bool has_robot_noise = options.robot != BundleOptions::Robot::kExact;
  const bool estimates_robot = options.robot == BundleOptions::Robot::kEstimatedNoise;
  const double detector_px = TypicalDetectorSigma(fit.problem->views).value_or(0);
  if (fit.unmodelled_sigma_px) fit.problem = WeightedByCovariance(*fit.problem, *fit.unmodelled_sigma_px);
  // The estimate of plain least squares does not depend on the noise.
  const bool is_least_squares = loss.name == "none" && !has_robot_noise && !options.camera_prior;
  constexpr int kMaxRounds = 30;
  for (int round = 0; round < kMaxRounds; ++round) {
    const ceres::Solver::Summary summary = Minimise(free, loss, scale, options, &fit);
    fit.convergence.converged = summary.termination_type == ceres::CONVERGENCE;
    fit.convergence.iterations += static_cast<int>(summary.iterations.size()) - 1;
    fit.convergence.seconds += summary.total_time_in_seconds;
    fit.convergence.message = summary.message;
    if (!fit.convergence.converged) {
      // The usual reason is missing information; the failure then names it.
      const std::optional<Information> weak = InformationAt(free, loss, options, &fit);
      std::optional<Failure> failure = weak ? CheckObservable(*weak) : std::nullopt;
      if (weak && !failure) failure = CheckUncertainty(InvertInformation(*weak, 1.0), fit.state.camera);
      return failure.value_or(Failure{"the refinement did not converge: " + summary.message});
    }
    if (options.pixel_noise_px && !estimates_robot) break;
    Noise next = fit.noise;
    if (has_robot_noise) {
      const EstimatedNoise estimated = EstimateNoise(fit, free, loss, options);
      next = estimated.noise;
      fit.robot_stddev = estimated.robot_stddev;
      fit.dof = estimated.dof;
    } else {
      const std::vector<double> distances = Joined(DistancesAt(*fit.problem, fit.state, options.num_threads));
      // The median is robust to 50 % outliers and is used while outliers are searched for.
      const double median_px = SigmaFromMedian(distances);
      fit.dof = std::max(1.0, 2.0 * static_cast<double>(distances.size()) - num_unknowns);
      next.pixel_px = scale == Scale::kMedian ? median_px : SigmaOfFit(distances, num_unknowns, loss, median_px);
    }
    bool settled = NoiseConverged(fit.noise, next, scale) || is_least_squares;
    fit.noise = next;
    if (detector_px > 0 && !options.pixel_noise_px) {
      const double next_px = UnmodelledSigmaPx(fit.noise.pixel_px, detector_px);
      if (!fit.unmodelled_sigma_px ||
          std::abs(next_px - *fit.unmodelled_sigma_px) > 0.02 * std::hypot(next_px, detector_px)) {
        settled = false;
        fit.unmodelled_sigma_px = next_px;
        fit.problem = WeightedByCovariance(*fit.problem, next_px);
      }
    }
    if (settled) break;
  }
  return fit;
}

using PointFlags = std::vector<std::vector<bool>>;  // Indexed by view and point.

// Returns flags for the points that pass their test at the estimate.
PointFlags FindInliers(const Problem& problem, const Fit& fit) {
  std::vector<View> views = problem.views;
  if (fit.unmodelled_sigma_px) WeightByCovariance(*fit.unmodelled_sigma_px, &views);
  PointFlags flags;
  for (size_t i = 0; i < views.size(); ++i) {
    const Rigid3d camera_from_target =
        CameraFromTarget(problem.setup, fit.state.hand_eye, views[i].camera_mount_from_target_mount,
                         fit.state.corrections.empty() ? Rigid3d() : fit.state.corrections[i]);
    flags.push_back(heba::FindInliers(fit.state.camera, camera_from_target,
                                      ApplyShape(views[i].observations, fit.state.shape), fit.noise.pixel_px));
  }
  return flags;
}

// Returns the problem with the flagged points only, without a copy if these are all.
SharedProblem KeepPoints(const Problem& problem, const PointFlags& keep) {
  const auto is_whole = [](const std::vector<bool>& view) {
    return std::find(view.begin(), view.end(), false) == view.end();
  };
  if (std::all_of(keep.begin(), keep.end(), is_whole)) return Borrowed(problem);
  auto kept = std::make_shared<Problem>(problem);
  for (size_t i = 0; i < kept->views.size(); ++i) {
    if (!is_whole(keep[i])) kept->views[i].observations = heba::KeepPoints(problem.views[i].observations, keep[i]);
  }
  return kept;
}

int Count(const PointFlags& flags) {
  int count = 0;
  for (const std::vector<bool>& view : flags) count += static_cast<int>(std::count(view.begin(), view.end(), true));
  return count;
}

// Returns a Failure unless there are more measured coordinates than unknowns.
std::optional<Failure> CheckCount(int num_points, const FreeParameters& free) {
  // If there were as many unknowns as measurements, no noise would be averaged.
  const int num_unknowns = 12 + static_cast<int>(std::count(free.begin(), free.end(), true));
  if (2 * num_points > num_unknowns) return std::nullopt;
  return Failure{std::to_string(2 * num_points) + " measured coordinates for " + std::to_string(num_unknowns) +
                 " unknowns are too few; take more captures or hold the intrinsics"};
}

// Least squares over the points that pass their test at the resulting estimate. The initial estimate uses the Cauchy
// loss, whose scale shrinks with the residuals, so outliers have little influence on it.
Outcome<Fit> RefineWithRejection(const Problem& problem, Fit fit, const FreeParameters& free,
                                 const BundleOptions& options, PointFlags* keep) {
  Outcome<Fit> settled = IterateNoiseAndFit(std::move(fit), free, *FindLoss("cauchy"), Scale::kMedian, options);
  if (!settled) return settled;
  constexpr int kMaxRounds = 20;
  for (int round = 0; round < kMaxRounds; ++round) {
    PointFlags inliers = FindInliers(problem, *settled);
    if (round > 0 && inliers == *keep) break;
    *keep = std::move(inliers);
    const int num_kept = Count(*keep);
    if (const std::optional<Failure> failure = CheckCount(num_kept, free)) return *failure;
    Fit next = *settled;
    next.problem = KeepPoints(problem, *keep);
    settled = IterateNoiseAndFit(std::move(next), free, *FindLoss("none"), Scale::kOfFit, options);
    if (!settled) return settled;
  }
  return settled;
}

}  // namespace

std::string BundleOptions::Check() const {
  std::vector<std::string> faults;
  if (FindLoss(loss) == nullptr) faults.push_back("loss '" + loss + "' is unknown; one of: " + Join(LossNames(), ", "));
  if (pixel_noise_px && !(*pixel_noise_px > 0)) faults.emplace_back("pixel_noise_px must be greater than zero");
  if (robot == Robot::kGivenNoise && !(robot_noise.translation_m >= 0 && robot_noise.rotation_rad >= 0)) {
    faults.emplace_back("robot_noise must not be negative");
  }
  if (max_iterations < 1) faults.emplace_back("max_iterations must be at least 1");
  return Join(faults, "\n");
}

FreeParameters FreeOf(const CameraModel& model, const BundleOptions& options) {
  return FreeOf(model, options.free_intrinsics, options.free_shape);
}

const Loss& InlierLoss(const BundleOptions& options) {
  return *FindLoss(options.loss == "truncated" ? "none" : options.loss);
}

Outcome<Solution> RefineHandEye(const Problem& problem_in, const HandEye& start, const BundleOptions& options) {
  const std::string faults = options.Check();
  CHECK(faults.empty()) << faults;
  const bool is_truncated = options.loss == "truncated";
  const FreeParameters free = FreeOf(problem_in.camera.Model(), options);

  std::vector<Rigid3d> poses;
  for (const View& view : problem_in.views) poses.push_back(view.camera_mount_from_target_mount);
  const std::string why_not = WhyNotObservable(AnalyseMotion(poses));
  if (!why_not.empty()) return Failure{why_not};
  const State start_state{start, problem_in.camera, problem_in.shape, {}};
  const ViewDistances start_distances = SquaredDistances(problem_in, start_state, options.num_threads);
  PointFlags keep;
  std::vector<std::string> hidden;
  for (size_t i = 0; i < problem_in.views.size(); ++i) {
    const bool is_visible = start_distances[i].has_value();
    keep.emplace_back(static_cast<size_t>(problem_in.views[i].observations.size()), is_visible);
    if (!is_visible) hidden.push_back(problem_in.views[i].name);
  }
  // A few captures may have a wrong pose, which `truncated` tolerates.
  if (hidden.size() > (is_truncated ? keep.size() / 2 : 0)) {
    return Failure{"with the start values the target of capture " + hidden.front() +
                   " lies behind the camera; another seed, or a check of set-up and pose direction, is needed"};
  }
  const SharedProblem visible = KeepPoints(problem_in, keep);
  const Problem& problem = *visible;
  if (const std::optional<Failure> failure = CheckCount(Count(keep), free)) return *failure;
  // Observability is checked at sigma = 0.05 px: a direction that is unobservable even then cannot be solved for.
  constexpr double kLittleNoisePx = 0.05;
  Fit fit;
  fit.problem = visible;
  fit.groups = std::make_shared<const PoseGroups>(GroupByRobotPose(problem.setup, problem.views));
  fit.state = start_state;
  fit.noise.pixel_px = options.pixel_noise_px.value_or(kLittleNoisePx);
  const std::optional<Information> start_information = InformationAt(free, *FindLoss("none"), options, &fit);
  CHECK(start_information.has_value());
  if (const std::optional<Failure> failure = CheckObservable(*start_information)) return *failure;
  if (const std::optional<Failure> failure =
          CheckUncertainty(InvertInformation(*start_information, 1.0), problem.camera)) {
    return *failure;
  }

  fit.noise.pixel_px = options.pixel_noise_px ? *options.pixel_noise_px : SigmaFromMedian(Joined(start_distances));
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
                                      : IterateNoiseAndFit(std::move(fit), free, loss, Scale::kOfFit, options);
  if (!settled) return Failure{settled.reason()};
  Solution solution;
  solution.hand_eye = settled->state.hand_eye;
  solution.camera = settled->state.camera;
  solution.shape = settled->state.shape;
  solution.pixel_sigma_px = settled->noise.pixel_px;
  solution.unmodelled_sigma_px = settled->unmodelled_sigma_px;
  solution.covariance_dof = settled->dof;
  solution.robot_noise = settled->noise.robot;
  if (options.robot == BundleOptions::Robot::kEstimatedNoise) solution.robot_noise_stddev = settled->robot_stddev;
  solution.corrections = settled->state.corrections;
  for (size_t i = 0; i < keep.size(); ++i) {
    solution.rejected_ids.emplace_back();
    for (size_t k = 0; k < keep[i].size(); ++k) {
      if (!keep[i][k]) solution.rejected_ids.back().push_back(problem_in.views[i].observations.ids[k]);
    }
  }
  solution.convergence = settled->convergence;
  const PoseGroups& groups = *settled->groups;
  solution.convergence.initial_cost = Cost(start_distances, start_state, groups, settled->noise, loss);
  solution.convergence.final_cost = Cost(DistancesAt(*settled->problem, settled->state, options.num_threads),
                                         settled->state, groups, settled->noise, loss);
  const std::optional<Information> information = InformationAt(free, loss, options, &*settled);
  CHECK(information.has_value());
  if (const std::optional<Failure> failure = CheckObservable(*information)) return *failure;
  solution.covariance = InvertInformation(*information, 1.0);
  const std::string camera_faults = CheckCamera(solution.camera);
  if (!camera_faults.empty()) return Failure{"the refined camera makes no sense: " + camera_faults};
  if (const std::optional<Failure> failure = CheckUncertainty(solution.covariance, solution.camera)) {
    return *failure;
  }
  return solution;
}

double LogLikelihoodOf(const Problem& problem, const Solution& solution, const BundleOptions& options) {
  const FreeParameters free = FreeOf(solution.camera.Model(), options);
  const Loss& loss = InlierLoss(options);
  const State state{solution.hand_eye, solution.camera, solution.shape, solution.corrections};
  const Noise noise{solution.pixel_sigma_px, solution.robot_noise};
  const std::optional<std::vector<LinearisedView>> views =
      Linearise(problem, state, GroupByRobotPose(problem.setup, problem.views), free, noise, loss, loss.consistency,
                options.camera_prior);
  if (!views) return -std::numeric_limits<double>::infinity();
  VarianceComponents variances;
  variances.pixel = loss.consistency;
  const RobotNoise robot = solution.robot_noise.value_or(RobotNoise{});
  variances.translation_m2 = robot.translation_m * robot.translation_m;
  variances.rotation_rad2 = robot.rotation_rad * robot.rotation_rad;
  const Eigen::Index num_shape =
      HasShape(free, solution.camera.Model()) ? std::count(free.end() - TargetShape::kNumParams, free.end(), true) : 0;
  return RestrictedLogLikelihood(*views, solution.pixel_sigma_px, variances, 12 + NumFree(free) - num_shape,
                                 options.robot_noise_prior ? &*options.robot_noise_prior : nullptr);
}

}  // namespace heba
