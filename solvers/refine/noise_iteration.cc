#include "solvers/refine/noise_iteration.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "solvers/residuals/noise_scale.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// A robot with smaller sigmas counts as exact: the prior then holds its corrections regardless of the images.
constexpr double kExactM = 1e-8;
constexpr double kExactRad = 1e-8;

struct EstimatedNoise {
  FitNoise noise;
  RobotNoise robot_stddev;
  double dof = 0;  // Degrees of freedom of the unknowns' covariance.
};

// Estimates the noise that explains the residuals best.
std::optional<EstimatedNoise> EstimateNoise(const Fit& fit, const FreeUnknowns& free, const Loss& loss,
                                            const BundleOptions& options) {
  const FitNoise& noise = fit.noise;
  const bool pixel_is_free = !options.pixel_noise_px;
  const bool robot_is_free = options.robot == BundleOptions::Robot::kEstimatedNoise;
  const std::optional<std::vector<LinearisedView>> views =
      LineariseFit(*fit.problem, fit.state, *fit.groups, free, noise, loss, loss.consistency, options);
  if (!views) return std::nullopt;
  std::vector<VarianceGroup> groups =
      WithEffectGroups(CorrectionGroups(loss.consistency, *noise.robot, pixel_is_free, robot_is_free,
                                        options.robot_noise_prior ? &*options.robot_noise_prior : nullptr,
                                        NumNoisyJoints(fit.problem->views)),
                       HandEyeUnknowns(fit.state.camera.Model(), free).Block(kRobotBlock), free.effects.get(),
                       noise.effect_sigmas, robot_is_free, options.effects_avoid_zero);
  // The noise of joints is kept from zero beside such effects: few captures leave little to tell it by.
  if (free.effects != nullptr && options.effects_avoid_zero && FirstEffectGroup(groups) > kJointGroup) {
    constexpr double kLeastRad = 1e-6;
    groups[kJointGroup].avoids_zero = robot_is_free;
    groups[kJointGroup].variance = std::max(groups[kJointGroup].variance, kLeastRad * kLeastRad);
  }
  const VarianceComponents found = EstimateVariances(*views, groups);
  EstimatedNoise result;
  result.noise.pixel_px =
      std::max(kMinSigmaPx, noise.pixel_px * std::sqrt(found.variances[kPixelGroup] / loss.consistency));
  result.noise.robot = AtLeastExact(RobotNoiseOf(groups, found));
  const size_t first_effect_group = FirstEffectGroup(groups);
  for (size_t g = 0; g < noise.effect_sigmas.size(); ++g) {
    result.noise.effect_sigmas.push_back(
        std::max(kExactEffect, std::sqrt(found.variances[static_cast<Eigen::Index>(first_effect_group + g)])));
  }
  // Converts the standard deviation of a variance to that of a sigma.
  result.robot_stddev = {
      0.5 * found.stddev[kTranslationGroup] / result.noise.robot->translation_m,
      0.5 * found.stddev[kRotationGroup] / result.noise.robot->rotation_rad,
      result.noise.robot->joint_rad > 0 ? 0.5 * found.stddev[kJointGroup] / result.noise.robot->joint_rad : 0.0};
  result.dof = DegreesOfFreedom(*views, groups, found);
  return result;
}

// Returns whether another round would change nothing of relevance: robot noise is known to a few per cent at best. A
// robot sigma near the lower bound counts as converged.
bool NoiseConverged(const FitNoise& noise, const FitNoise& next, NoiseScale scale) {
  constexpr double kRough = 0.02;
  const double robot_tolerance = scale == NoiseScale::kMedian ? kRough : 1e-3;
  const auto is_close = [&](double a, double b, double exact) {
    return std::abs(a - b) < robot_tolerance * std::max(a, b) || std::max(a, b) <= 2 * exact;
  };
  const double pixel_tolerance = scale == NoiseScale::kMedian ? kRough : next.robot ? 1e-4 : 1e-6;
  if (std::abs(next.pixel_px - noise.pixel_px) >= pixel_tolerance * noise.pixel_px) return false;
  for (size_t g = 0; g < next.effect_sigmas.size(); ++g) {
    if (!is_close(noise.effect_sigmas[g], next.effect_sigmas[g], kExactEffect)) return false;
  }
  return !next.robot || (is_close(noise.robot->translation_m, next.robot->translation_m, kExactM) &&
                         is_close(noise.robot->rotation_rad, next.robot->rotation_rad, kExactRad) &&
                         is_close(noise.robot->joint_rad, next.robot->joint_rad, kExactRad));
}

// Returns a copy of the problem, whitened with the detectors' covariances and the unmodelled sigma.
SharedProblem WeightedByCovariance(const Problem& problem, double unmodelled_sigma_px) {
  auto weighted = std::make_shared<Problem>(problem);
  WeightByCovariance(unmodelled_sigma_px, &weighted->views);
  return weighted;
}

}  // namespace

RobotNoise AtLeastExact(const RobotNoise& noise) {
  return {std::max(noise.translation_m, kExactM), std::max(noise.rotation_rad, kExactRad), noise.joint_rad};
}

double UnmodelledSigmaPx(double pixel_sigma_px, double detector_px) {
  constexpr double kLeastPx = 0.005;
  return std::sqrt(std::max(kLeastPx * kLeastPx, pixel_sigma_px * pixel_sigma_px - detector_px * detector_px));
}

Outcome<Fit> IterateNoiseAndFit(Fit fit, const FreeUnknowns& free, const Loss& loss, NoiseScale scale,
                                const BundleOptions& options) {
  const int num_unknowns = static_cast<int>(HandEyeUnknowns(fit.state.camera.Model(), free).size());
  const bool has_robot_noise = options.robot != BundleOptions::Robot::kExact;
  const bool estimates_robot = options.robot == BundleOptions::Robot::kEstimatedNoise;
  const double detector_px = TypicalDetectorSigma(fit.problem->views).value_or(0);
  if (fit.unmodelled_sigma_px) fit.problem = WeightedByCovariance(*fit.problem, *fit.unmodelled_sigma_px);
  // The estimate of plain least squares does not depend on the noise.
  const bool has_priors = options.camera_prior || options.target_scale_sigma || free.effects != nullptr;
  const bool is_least_squares = loss.kind == LossKind::kNone && !has_robot_noise && !has_priors;
  constexpr int kMaxRounds = 30;
  for (int round = 0; round < kMaxRounds; ++round) {
    const ceres::Solver::Summary summary = MinimiseOnce(free, loss, scale, options, &fit);
    fit.convergence.converged = summary.termination_type == ceres::CONVERGENCE;
    fit.convergence.iterations += static_cast<int>(summary.iterations.size()) - 1;
    fit.convergence.seconds += summary.total_time_in_seconds;
    fit.convergence.message = summary.message;
    if (!fit.convergence.converged) {
      // The usual reason is missing information; the failure then names it.
      const std::optional<Information> weak = FitInformation(free, loss, options, &fit);
      const std::optional<Failure> failure = weak ? CheckObservable(*weak) : std::nullopt;
      return failure.value_or(Failure{"the refinement did not converge: " + summary.message});
    }
    if (options.pixel_noise_px && !estimates_robot) break;
    FitNoise next = fit.noise;
    if (has_robot_noise) {
      const std::optional<EstimatedNoise> estimated = EstimateNoise(fit, free, loss, options);
      if (!estimated) return HiddenPoint();
      next = estimated->noise;
      fit.robot_stddev = estimated->robot_stddev;
      fit.dof = estimated->dof;
    } else {
      const std::optional<ViewDistances> at = DistancesAt(*fit.problem, free, fit.state, options.num_threads);
      if (!at) return HiddenPoint();
      const std::vector<double> distances = JoinDistances(*at);
      // The median is robust to 50 % outliers and is used while outliers are searched for.
      const double median_px = SigmaFromMedian(distances);
      fit.dof = std::max(1.0, 2.0 * static_cast<double>(distances.size()) - num_unknowns);
      next.pixel_px = scale == NoiseScale::kMedian ? median_px : SigmaOfFit(distances, num_unknowns, loss, median_px);
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

}  // namespace heba
