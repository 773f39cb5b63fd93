#include "solvers/refine/noise_iteration.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include "heba/base/failure_code.h"
#include "solvers/refine/linearised_images.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// A robot with smaller sigmas counts as exact: the prior then holds its corrections regardless of the images.
constexpr double kExactM = 1e-8;
constexpr double kExactRad = 1e-8;

// The noise of a fit, estimated anew.
struct EstimatedNoise {
  FitNoise noise;
  std::vector<RobotNoise> robot_stddev;
  std::function<double()> dof;  // Returns the degrees of freedom of the unknowns' covariance.
};

// Returns whether errors of images as a whole can be told from those of the arms: by captures with several images.
bool HasImageErrors(const Problem& problem) {
  return std::any_of(problem.captures.begin(), problem.captures.end(), [](const ProblemCapture& capture) {
    const auto has_points = [](const ProblemImage& image) { return image.observations.size() > 0; };
    return std::count_if(capture.images.begin(), capture.images.end(), has_points) > 1;
  });
}

// Returns whether all points have one variance, up to their weights.
bool HasOnePixelVariance(const Problem& problem) { return problem.cameras.size() == 1 && !HasImageErrors(problem); }

// Estimates the two sigmas of each camera from its residuals and their redundancy: that of the points from the part
// that no other pose of the target explains, that of the images, if they have errors, from the part that one does.
void EstimateCameraNoise(const Fit& fit, const LinearisedImages& images, const Eigen::MatrixXd& covariance,
                         FitNoise* noise) {
  const std::vector<size_t> moving = MovingRobots(*fit.problem);
  const Eigen::VectorXd variances = CorrectionVariances(fit.noise, NoisyJointsOf(*fit.problem, moving));
  const bool has_image_errors = HasImageErrors(*fit.problem);
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
    const Eigen::VectorXd corrections = CorrectionTangents(fit.state, images.images[group.front()].capture, moving);
    for (const size_t v : group) {
      const LinearisedView& view = images.views[v];
      const ImageIndex& index = images.images[v];
      const ProblemImage& image = fit.problem->captures[index.capture].images[index.image];
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
    if (!has_image_errors || sums.pose_dof < kLeastDof) continue;
    const double image_px2 = 3 * (old_px2 * sums.pose - pixel_px2 * sums.pose_dof) / sums.pose_dof_points;
    noise->image_px[c] = std::sqrt(std::max(0.0, image_px2));
  }
}

// Returns the pixel sigma of each camera by the median of its points.
std::vector<double> MedianSigmas(const Fit& fit, int num_threads) {
  const ImageDistances distances = DistancesAt(*fit.problem, fit.groups, fit.state, num_threads);
  std::vector<double> sigmas_px;
  for (std::vector<double>& of_camera : DistancesOfCameras(*fit.problem, fit.groups, distances)) {
    sigmas_px.push_back(SigmaFromMedian(std::move(of_camera)));
  }
  return sigmas_px;
}

// Estimates the pixel noise of a single camera and of exact arms.
std::optional<EstimatedNoise> EstimatePixelNoise(const Fit& fit, const Loss& loss, NoiseScale scale,
                                                 const AdjustmentOptions& options) {
  const ImageDistances at = DistancesAt(*fit.problem, fit.groups, fit.state, options.num_threads);
  if (std::any_of(at.begin(), at.end(), [](const auto& of_image) { return !of_image.has_value(); }))
    return std::nullopt;
  const std::vector<double> distances = DistancesOfCameras(*fit.problem, fit.groups, at).front();
  const auto num_unknowns = static_cast<int>(UnknownsOf(*fit.problem).size());
  EstimatedNoise result{fit.noise, {}, {}};
  const double dof = std::max(1.0, 2.0 * static_cast<double>(distances.size()) - num_unknowns);
  result.dof = [dof] { return dof; };
  // The median is robust to 50 % outliers and is used while outliers are searched for.
  const double median_px = SigmaFromMedian(distances);
  result.noise.pixel_px[0] =
      scale == NoiseScale::kMedian ? median_px : SigmaOfFit(distances, num_unknowns, loss, median_px);
  return result;
}

// Returns the groups of the variances of a fit.
std::vector<VarianceGroup> GroupsOf(const Fit& fit, const Loss& loss, const AdjustmentOptions& options) {
  const bool robots_are_free = options.robot == BundleOptions::Robot::kEstimatedNoise;
  std::vector<VarianceGroup> groups = VarianceGroupsOf(*fit.problem, fit.noise,
                                                       {loss.consistency, !options.pixel_noise_px, robots_are_free,
                                                        options.robot_noise_prior, options.effects_avoid_zero});
  // The noise of each capture is kept from zero beside such effects, too: few captures leave little to tell it by.
  const bool has_effects = FirstEffectGroup(groups) < groups.size();
  if (!robots_are_free || !has_effects || !options.effects_avoid_zero) return groups;
  for (VarianceGroup& group : groups) {
    if (group.kind != VarianceGroup::Kind::kEffects) continue;
    constexpr double kLeast = 1e-6;  // m or rad
    group.avoids_zero = true;
    group.variance = std::max(group.variance, kLeast * kLeast);
  }
  return groups;
}

// Estimates the noise that explains the residuals best.
std::optional<EstimatedNoise> EstimateNoise(const Fit& fit, const Loss& loss, NoiseScale scale,
                                            const AdjustmentOptions& options) {
  const bool has_one_variance = HasOnePixelVariance(*fit.problem);
  if (has_one_variance && fit.noise.robots.empty()) return EstimatePixelNoise(fit, loss, scale, options);
  EstimatedNoise result{fit.noise, {}, {}};
  std::vector<LinearisedView> views;
  if (has_one_variance || options.pixel_noise_px || scale == NoiseScale::kMedian) {
    std::optional<std::vector<LinearisedView>> captures = LineariseCaptures(
        CaptureLoops(*fit.problem, fit.groups, fit.state, fit.noise, true), ValuesOf(fit.state), 1, loss);
    if (!captures) return std::nullopt;
    views = std::move(*captures);
    if (!has_one_variance && !options.pixel_noise_px) result.noise.pixel_px = MedianSigmas(fit, options.num_threads);
  } else {
    const std::optional<LinearisedImages> images =
        LineariseImages(*fit.problem, fit.groups, fit.state, fit.noise, loss);
    if (!images) return std::nullopt;
    views = StackGroups(images->views, images->groups);
    EstimateCameraNoise(fit, *images, InvertInformation(InformationOf(fit, views, loss), 1.0).matrix, &result.noise);
  }
  for (LinearisedView& view : PriorViews(*fit.problem, fit.state, loss.consistency, views.front().by_effects.cols())) {
    views.push_back(std::move(view));
  }
  const std::vector<VarianceGroup> groups = GroupsOf(fit, loss, options);
  const VarianceComponents found = EstimateVariances(views, groups);
  if (!options.pixel_noise_px && has_one_variance) {
    const double ratio = std::sqrt(found.variances[kPixelGroup] / loss.consistency);
    result.noise.pixel_px[0] = std::max(kMinSigmaPx, ratio * fit.noise.pixel_px[0]);
  }
  // The groups are in the order of the arms.
  size_t next = kTranslationGroup;
  const std::vector<Eigen::Index> num_joints = NoisyJointsOf(*fit.problem, MovingRobots(*fit.problem));
  const auto sigma_of = [&](size_t g) { return std::sqrt(found.variances[static_cast<Eigen::Index>(g)]); };
  // Converts the standard deviation of a variance to that of a sigma.
  const auto stddev_of = [&](size_t g, double sigma) {
    return sigma > 0 ? 0.5 * found.stddev[static_cast<Eigen::Index>(g)] / sigma : 0.0;
  };
  for (size_t k = 0; k < fit.noise.robots.size(); ++k) {
    const bool has_joints = num_joints[k] > 0;
    RobotNoise& robot = result.noise.robots[k];
    robot = AtLeastExact({sigma_of(next), sigma_of(next + 1), has_joints ? sigma_of(next + 2) : 0.0});
    result.robot_stddev.push_back({stddev_of(next, robot.translation_m), stddev_of(next + 1, robot.rotation_rad),
                                   has_joints ? stddev_of(next + 2, robot.joint_rad) : 0.0});
    next += has_joints ? 3 : 2;
  }
  for (std::vector<double>& sigmas : result.noise.effect_sigmas) {
    for (double& sigma : sigmas) sigma = std::max(kExactEffect, sigma_of(next++));
  }
  result.dof = [views = std::move(views), groups, found] { return DegreesOfFreedom(views, groups, found); };
  return result;
}

// Returns whether another round would change nothing of relevance: the noise of arms is known to a few per cent at
// best. A sigma of an arm near the lower bound counts as converged.
bool NoiseConverged(const FitNoise& noise, const FitNoise& next, NoiseScale scale) {
  constexpr double kRough = 0.02;
  const double robot_tolerance = scale == NoiseScale::kMedian ? kRough : 1e-3;
  const double pixel_tolerance = scale == NoiseScale::kMedian ? kRough : next.robots.empty() ? 1e-6 : 1e-4;
  const auto is_close = [&](double a, double b, double exact) {
    return std::abs(a - b) < robot_tolerance * std::max(a, b) || std::max(a, b) <= 2 * exact;
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
    if (!is_close(noise.robots[k].translation_m, next.robots[k].translation_m, kExactM) ||
        !is_close(noise.robots[k].rotation_rad, next.robots[k].rotation_rad, kExactRad) ||
        !is_close(noise.robots[k].joint_rad, next.robots[k].joint_rad, kExactRad)) {
      return false;
    }
  }
  for (size_t r = 0; r < noise.effect_sigmas.size(); ++r) {
    for (size_t g = 0; g < noise.effect_sigmas[r].size(); ++g) {
      if (!is_close(noise.effect_sigmas[r][g], next.effect_sigmas[r][g], kExactEffect)) return false;
    }
  }
  return true;
}

// Updates the unmodelled part of each camera's noise and the weights that follow from it. Returns whether they changed.
bool UpdateWeights(Fit* fit) {
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
    fit->problem = std::make_shared<const Problem>(WeightPoints(*fit->problem, fit->unmodelled_sigma_px));
  return has_changed;
}

// Returns whether the estimate is one of plain least squares, which does not depend on the noise.
bool IsLeastSquares(const Fit& fit, const Loss& loss) {
  const Problem& problem = *fit.problem;
  const auto has_prior = [](const ProblemCamera& camera) { return camera.prior.has_value(); };
  const auto has_scale = [](const ProblemTarget& target) { return target.scale_sigma.has_value(); };
  const auto has_effects = [](const Eigen::VectorXd& effects) { return effects.size() > 0; };
  return loss.kind == LossKind::kNone && problem.prior == nullptr && fit.noise.robots.empty() &&
         HasOnePixelVariance(problem) &&
         std::none_of(fit.state.effects.begin(), fit.state.effects.end(), has_effects) &&
         std::none_of(problem.cameras.begin(), problem.cameras.end(), has_prior) &&
         std::none_of(problem.targets.begin(), problem.targets.end(), has_scale);
}

}  // namespace

RobotNoise AtLeastExact(const RobotNoise& noise) {
  return {std::max(noise.translation_m, kExactM), std::max(noise.rotation_rad, kExactRad), noise.joint_rad};
}

double UnmodelledSigmaPx(double pixel_sigma_px, double detector_px) {
  constexpr double kLeastPx = 0.005;
  return std::sqrt(std::max(kLeastPx * kLeastPx, pixel_sigma_px * pixel_sigma_px - detector_px * detector_px));
}

Outcome<Fit> IterateNoiseAndFit(Fit fit, const Loss& loss, NoiseScale scale, const AdjustmentOptions& options) {
  if (std::any_of(fit.unmodelled_sigma_px.begin(), fit.unmodelled_sigma_px.end(),
                  [](const auto& sigma_px) { return sigma_px.has_value(); })) {
    fit.problem = std::make_shared<const Problem>(WeightPoints(*fit.problem, fit.unmodelled_sigma_px));
  }
  const bool is_least_squares = IsLeastSquares(fit, loss);
  constexpr int kMaxRounds = 30;
  for (int round = 0; round < kMaxRounds; ++round) {
    const ceres::Solver::Summary summary = MinimiseOnce(loss, scale, options, &fit);
    fit.convergence.converged = summary.termination_type == ceres::CONVERGENCE;
    fit.convergence.iterations += static_cast<int>(summary.iterations.size()) - 1;
    fit.convergence.seconds += summary.total_time_in_seconds;
    fit.convergence.message = summary.message;
    if (!fit.convergence.converged) {
      // The usual reason is missing information; the failure then names it.
      const std::optional<Information> weak = FitInformation(fit, loss, options.num_threads);
      const std::optional<Failure> failure = weak ? CheckObservable(*weak) : std::nullopt;
      return failure.value_or(Failure{FailureCode("not_converged"), {}, {{"message", summary.message}}});
    }
    if (options.pixel_noise_px && options.robot != BundleOptions::Robot::kEstimatedNoise) break;
    std::optional<EstimatedNoise> next = EstimateNoise(fit, loss, scale, options);
    if (!next) return HiddenPoint();
    bool has_settled = NoiseConverged(fit.noise, next->noise, scale) || is_least_squares;
    fit.noise = std::move(next->noise);
    fit.robot_stddev = std::move(next->robot_stddev);
    if (!options.pixel_noise_px && UpdateWeights(&fit)) has_settled = false;
    if (has_settled || round + 1 == kMaxRounds) {
      fit.dof = next->dof();
      break;
    }
  }
  return fit;
}

}  // namespace heba
