#include "solvers/refine/fit.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/failure_code.h"
#include "heba/base/parallel.h"
#include "heba/data/free_parameters.h"
#include "heba/geometry/pose_block.h"
#include "solvers/refine/reprojection_problem.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/residuals/view_reduction.h"
#include "solvers/uncertainty/block_prior.h"
#include "solvers/uncertainty/joint_prior_rows.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Returns what is known about the cameras and about the scales of the targets.
std::vector<BlockPrior> PriorsOfCamerasAndTargets(const Problem& problem) {
  std::vector<BlockPrior> priors;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const ProblemCamera& camera = problem.cameras[c];
    if (!camera.prior || camera.free_intrinsics.empty()) continue;
    priors.push_back(PriorOfCamera(*camera.prior, FreeOf(camera.camera.Model(), camera.free_intrinsics), c));
  }
  for (size_t t = 0; t < problem.targets.size(); ++t) {
    if (problem.targets[t].scale_sigma) priors.push_back(PriorOfScales(*problem.targets[t].scale_sigma, t));
  }
  return priors;
}

// Returns the inverse standard deviations of an arm's effects.
Eigen::VectorXd EffectWeights(const SharedEffects& effects, const std::vector<double>& sigmas) {
  Eigen::VectorXd weights(effects.size());
  for (Eigen::Index i = 0; i < weights.size(); ++i) {
    weights[i] = 1 / sigmas[effects.effects[static_cast<size_t>(i)].group];
  }
  return weights;
}

// Returns the priors of the arms' effects.
std::vector<BlockPrior> PriorsOfArms(const Problem& problem, const FitNoise& noise) {
  std::vector<BlockPrior> priors;
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr) continue;
    const size_t index = priors.size();
    priors.push_back(PriorOfEffects(EffectWeights(*effects, noise.effect_sigmas[r]), index));
  }
  return priors;
}

// Returns the information with that of all priors.
Information WithPriors(Information information, const Fit& fit) {
  for (const auto& priors : {PriorsOfArms(*fit.problem, fit.noise), PriorsOfCamerasAndTargets(*fit.problem)}) {
    for (const BlockPrior& prior : priors) information = WithPrior(std::move(information), prior);
  }
  if (fit.problem->prior == nullptr) return information;
  const JointPriorRows rows = RowsOf(*fit.problem->prior, information.layout, ValuesOf(fit.state));
  information.matrix += rows.by_unknowns.transpose() * rows.by_unknowns;
  return information;
}

bool IsZero(const Rigid3d& correction) {
  return correction.translation.isZero(0) && correction.rotation.vec().isZero(0);
}

}  // namespace

FitState StateOf(const Solution& solution) {
  FitState state{solution.poses, solution.cameras, solution.shapes, {}, solution.effects};
  for (const CaptureOutcome& capture : solution.captures) {
    if (!capture.corrections.empty()) state.corrections.push_back(capture.corrections);
  }
  return state;
}

FitNoise NoiseOf(const Solution& solution) {
  FitNoise noise{solution.pixel_sigmas_px, solution.image_sigmas_px, {}, solution.effect_sigmas};
  for (const std::optional<RobotNoise>& robot : solution.robot_noise) {
    if (robot) noise.robots.push_back(*robot);
  }
  return noise;
}

Fit WithStartOfEffects(Fit fit, const Problem& problem) {
  if (problem.effects.empty()) return fit;
  fit.state.effects.resize(problem.robots.size());
  fit.noise.effect_sigmas.resize(problem.robots.size());
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr || fit.state.effects[r].size() > 0) continue;
    fit.state.effects[r].setZero(effects->size());
    for (const EffectGroup& group : effects->groups) fit.noise.effect_sigmas[r].push_back(group.sigma);
  }
  return fit;
}

Problem WeightPoints(Problem problem, const std::vector<std::optional<double>>& unmodelled_sigma_px) {
  std::vector<std::vector<Observations*>> of_cameras(problem.cameras.size());
  for (ProblemCapture& capture : problem.captures) {
    for (ProblemImage& image : capture.images) of_cameras[image.camera].push_back(&image.observations);
  }
  for (size_t c = 0; c < of_cameras.size(); ++c) {
    if (unmodelled_sigma_px[c]) WeightByCovariance(*unmodelled_sigma_px[c], of_cameras[c]);
  }
  return problem;
}

Problem WeightedAs(const Solution& solution, Problem problem) {
  return WeightPoints(std::move(problem), solution.unmodelled_sigma_px);
}

Problem WithFixedWeights(Problem problem, const Solution& solution) {
  Problem fixed = WeightedAs(solution, std::move(problem));
  for (ProblemCapture& capture : fixed.captures) {
    for (ProblemImage& image : capture.images) image.observations.covariances_px2.clear();
  }
  return fixed;
}

std::vector<std::vector<const Observations*>> PointsOfCameras(const Problem& problem) {
  std::vector<std::vector<const Observations*>> all(problem.cameras.size());
  for (const ProblemCapture& capture : problem.captures) {
    for (const ProblemImage& image : capture.images) all[image.camera].push_back(&image.observations);
  }
  return all;
}

ImageDistances DistancesAt(const Problem& problem, const CaptureGroups& groups, const FitState& state,
                           int num_threads) {
  const std::vector<ImageIndex> images = ImagesOf(problem, groups);
  int num_points = 0;
  const auto image_of = [&](const ImageIndex& index) -> const ProblemImage& {
    return problem.captures[index.capture].images[index.image];
  };
  for (const ImageIndex& index : images) num_points += image_of(index).observations.size();
  ImageDistances distances(images.size());
  ParallelFor(static_cast<int>(images.size()), ThreadsFor(num_points, num_threads), [&](int index) {
    const auto v = static_cast<size_t>(index);
    const ProblemImage& image = image_of(images[v]);
    const Camera& camera = state.cameras[image.camera];
    const TargetShape& shape = state.shapes[image.target];
    distances[v] = WhitenedSquares(camera.Model(), camera.params.data(), PredictedPose(problem, state, images[v]),
                                   image.observations, shape.params == TargetShape().params ? nullptr : &shape);
  });
  return distances;
}

std::vector<std::vector<double>> DistancesOfCameras(const Problem& problem, const CaptureGroups& groups,
                                                    const ImageDistances& distances) {
  std::vector<std::vector<double>> of_cameras(problem.cameras.size());
  const std::vector<ImageIndex> images = ImagesOf(problem, groups);
  for (size_t v = 0; v < images.size(); ++v) {
    if (!distances[v]) continue;
    std::vector<double>& of_camera = of_cameras[problem.captures[images[v].capture].images[images[v].image].camera];
    of_camera.insert(of_camera.end(), distances[v]->begin(), distances[v]->end());
  }
  return of_cameras;
}

Failure HiddenPoint() { return FailureCode("hidden_point"); }

std::vector<double> GroupCosts(const Problem& problem, const CaptureGroups& groups, const FitState& state,
                               const FitNoise& noise, const Loss& loss) {
  std::vector<ViewReducer> reducers;  // One for each camera.
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    const CameraModel& model = state.cameras[c].Model();
    reducers.emplace_back(model, FreeParameters(static_cast<size_t>(NumParams(model)), false), noise.pixel_px[c], loss);
  }
  const std::vector<size_t> moving = MovingRobots(problem);
  std::vector<double> costs;
  ViewNormalEquations products;
  for (const std::vector<size_t>& group : groups) {
    double& cost = costs.emplace_back(0);
    for (const size_t i : group) {
      for (size_t k = 0; k < problem.captures[i].images.size(); ++k) {
        const ProblemImage& image = problem.captures[i].images[k];
        if (image.observations.size() == 0) continue;
        if (!reducers[image.camera].Multiply(
                state.cameras[image.camera].params.data(), PredictedPose(problem, state, {i, k}),
                ApplyShape(image.observations, state.shapes[image.target]), nullptr, &products)) {
          cost = std::numeric_limits<double>::infinity();
          continue;
        }
        WeighPosePart(PoseVarianceRatio(noise, image), &products.matrix);
        cost += 0.5 * (products.matrix(6, 6) + products.loss_remainder);
      }
    }
    if (state.corrections.empty()) continue;
    const ProblemCapture& first = problem.captures[group.front()];
    for (size_t k = 0; k < moving.size(); ++k) {
      const Matrix6 prior = CorrectionPrior(
          noise.robots[k], first.postures.empty() ? Matrix6X(6, 0) : first.postures[moving[k]].gripper_by_joints);
      cost += 0.5 * (prior * LocalCoordinates(Rigid3d(), state.corrections[group.front()][moving[k]])).squaredNorm();
    }
  }
  return costs;
}

double FitCost(const Problem& problem, const CaptureGroups& groups, const FitState& state, const FitNoise& noise,
               const Loss& loss) {
  double sum = 0;
  for (const double cost : GroupCosts(problem, groups, state, noise, loss)) sum += cost;
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr) continue;
    sum += 0.5 * EffectWeights(*effects, noise.effect_sigmas[r]).cwiseProduct(state.effects[r]).squaredNorm();
  }
  return sum;
}

std::vector<LinearisedView> PriorViews(const Problem& problem, const FitState& state, double row_variance,
                                       Eigen::Index num_effects) {
  const UnknownLayout layout = UnknownsOf(problem);
  const LoopValues values = ValuesOf(state);
  std::vector<LinearisedView> views;
  for (const BlockPrior& prior : PriorsOfCamerasAndTargets(problem)) {
    views.push_back(PriorView(prior, layout, values, row_variance, num_effects));
  }
  if (problem.prior != nullptr) {
    views.push_back(AsView(RowsOf(*problem.prior, layout, values), row_variance, num_effects));
  }
  return views;
}

std::optional<std::vector<LinearisedView>> LineariseFit(const Problem& problem, const CaptureGroups& groups,
                                                        const FitState& state, const FitNoise& noise, const Loss& loss,
                                                        double prior_row_variance) {
  // Without corrections the columns of the effects are still needed: their variance may be zero.
  std::optional<std::vector<LinearisedView>> views =
      LineariseCaptures(CaptureLoops(problem, groups, state, noise, true), ValuesOf(state), 1, loss);
  if (!views) return views;
  for (LinearisedView& view : PriorViews(problem, state, prior_row_variance, views->front().by_effects.cols())) {
    views->push_back(std::move(view));
  }
  return views;
}

Eigen::VectorXd CorrectionVariances(const FitNoise& noise, const std::vector<Eigen::Index>& num_joints) {
  const auto num_moving = static_cast<Eigen::Index>(num_joints.size());
  Eigen::Index size = 6 * num_moving;
  for (const Eigen::Index num : num_joints) size += num;
  Eigen::VectorXd variances = Eigen::VectorXd::Zero(size);
  Eigen::Index first_joint = 6 * num_moving;
  for (size_t k = 0; k < noise.robots.size(); ++k) {
    const Eigen::VectorXd of_arm = CorrectionVariances(noise.robots[k], 6 + num_joints[k]);
    variances.segment<6>(6 * static_cast<Eigen::Index>(k)) = of_arm.head<6>();
    variances.segment(first_joint, num_joints[k]) = of_arm.tail(num_joints[k]);
    first_joint += num_joints[k];
  }
  return variances;
}

std::vector<VarianceGroup> VarianceGroupsOf(const Problem& problem, const FitNoise& noise,
                                            const VarianceSetting& setting) {
  const std::vector<Eigen::Index> num_joints = NoisyJointsOf(problem, MovingRobots(problem));
  std::vector<VarianceGroup> groups = {
      {VarianceGroup::Kind::kPixels, {}, setting.pixel_variance, setting.pixel_is_free}};
  Eigen::Index first_joint = 6 * static_cast<Eigen::Index>(num_joints.size());
  for (size_t k = 0; k < noise.robots.size(); ++k) {
    const std::vector<VarianceGroup> of_arm =
        CorrectionGroups(1, noise.robots[k], false, setting.robots_are_free,
                         setting.robot_prior ? &*setting.robot_prior : nullptr, num_joints[k]);
    for (size_t g = kTranslationGroup; g < of_arm.size(); ++g) {
      const Eigen::Index shift = g == kJointGroup ? first_joint - 6 : 6 * static_cast<Eigen::Index>(k);
      groups.push_back(of_arm[g]);
      for (Eigen::Index& column : groups.back().columns) column += shift;
    }
    first_joint += num_joints[k];
  }
  const UnknownLayout layout = UnknownsOf(problem);
  for (size_t r = 0; r < problem.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(problem, r);
    if (effects == nullptr) continue;
    groups = WithEffectGroups(std::move(groups), layout.Block(ErrorsBlock(problem.robots[r])), effects,
                              noise.effect_sigmas[r], setting.robots_are_free, setting.effects_avoid_zero);
  }
  return groups;
}

ceres::Solver::Summary MinimiseOnce(const Loss& loss, NoiseScale scale, const AdjustmentOptions& fit_options,
                                    Fit* fit) {
  CapturesCostOptions options;
  options.loss = &loss;
  options.num_threads = fit_options.num_threads;
  // All corrections are zero before the first solve.
  options.eliminated_poses_are_rough =
      std::all_of(fit->state.corrections.begin(), fit->state.corrections.end(),
                  [&](const auto& of_capture) { return std::all_of(of_capture.begin(), of_capture.end(), IsZero); });
  LoopProblem loops = CaptureLoops(*fit->problem, fit->groups, fit->state, fit->noise, !fit->state.corrections.empty());
  LoopUnknowns unknowns(loops.layout, ValuesOf(fit->state));
  options.priors = PriorsOfArms(*fit->problem, fit->noise);
  for (BlockPrior& prior : PriorsOfCamerasAndTargets(*fit->problem)) options.priors.push_back(std::move(prior));
  CapturesCost cost(std::move(loops), std::move(options));
  ceres::Solver::Options solver_options = ReprojectionSolverOptions(fit_options.max_iterations);
  constexpr double kRough = 1e-6;
  if (scale == NoiseScale::kMedian) solver_options.function_tolerance = kRough;
  ceres::Solver::Summary summary = SolveCaptures(solver_options, &cost, &unknowns, fit->problem->prior.get());
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

std::optional<Information> FitInformation(const Fit& fit, const Loss& loss, int num_threads) {
  if (!fit.noise.robots.empty()) {
    // The Schur complement of the normal equations is equivalent, but cancellation leaves no significant digits if the
    // images are far more exact than the arms.
    const std::optional<std::vector<LinearisedView>> captures = LineariseCaptures(
        CaptureLoops(*fit.problem, fit.groups, fit.state, fit.noise, true), ValuesOf(fit.state), 1, loss);
    if (!captures) return std::nullopt;
    return InformationOf(fit, *captures, loss);
  }
  Information information{UnknownsOf(*fit.problem), {}};
  CapturesCostOptions options;
  options.loss = &loss;
  options.num_threads = num_threads;
  const LoopUnknowns unknowns(information.layout, ValuesOf(fit.state));
  const std::optional<NormalEquations> products =
      CapturesCost(CaptureLoops(*fit.problem, fit.groups, fit.state, fit.noise, false), options)
          .NormalEquationsAt(unknowns.blocks().data());
  if (!products) return std::nullopt;
  const Eigen::Index size = information.layout.size();
  information.matrix = products->matrix.topLeftCorner(size, size) / loss.covariance_factor();
  return WithPriors(std::move(information), fit);
}

Information InformationOf(const Fit& fit, const std::vector<LinearisedView>& captures, const Loss& loss) {
  const std::vector<Eigen::Index> num_joints = NoisyJointsOf(*fit.problem, MovingRobots(*fit.problem));
  // The information of the pixels' rows is 1 / factor of their weighted normal matrix (Loss::covariance_factor).
  Information information{
      UnknownsOf(*fit.problem),
      MarginalInformation(captures, CorrectionVariances(fit.noise, num_joints), loss.covariance_factor())};
  return WithPriors(std::move(information), fit);
}

}  // namespace heba
