// Bundle adjustment: refines hand-eye pose, board pose and camera intrinsics jointly, by minimising the whitened
// reprojection error of every point in every view. docs/estimation.md derives the cost and the covariance.
//
//   heba::BundleOptions options;
//   options.robot = heba::BundleOptions::Robot::kEstimatedNoise;
//   const heba::Outcome<heba::Solution> solution =
//       heba::RefineHandEye({camera, views, setup}, start, options);
//   if (solution) Use(solution->hand_eye, solution->covariance);
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/camera_prior.h"
#include "heba/data/loss_kind.h"
#include "heba/data/solution.h"

namespace heba {

// One sigma of the scales of a printed target, if the robot has systematic errors: the scale of the target and the size
// of an arm are nearly one, and prints are off by some tenths of a per cent.
inline constexpr double kPrintScaleSigma = 0.003;

struct BundleOptions {
  std::vector<ParameterGroup> free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint,
                                                 ParameterGroup::kDistortion};
  // The unknown parts of the target's shape; Problem::shape is the initial guess.
  std::vector<TargetShapeGroup> free_shape;
  LossKind loss = LossKind::kTruncated;
  // Sigma of one coordinate, px. Nothing: estimated from the residuals.
  std::optional<double> pixel_noise_px;
  // Treats the robot poses as exact, as observations with the given noise, or as observations with a noise that is
  // estimated together with the pixel noise (by restricted maximum likelihood).
  enum class Robot { kExact, kGivenNoise, kEstimatedNoise };
  Robot robot = Robot::kExact;
  RobotNoise robot_noise;  // Used with kGivenNoise.
  // Used with kEstimatedNoise: prior of the robot noise, for captures that are too few to determine it.
  std::optional<RobotNoisePrior> robot_noise_prior;
  // Used with kEstimatedNoise: initial guess of the robot noise. The default is an inaccurate robot.
  RobotNoise robot_noise_start = {1e-3, 2e-3, 1e-3};
  // The systematic errors of the robot that are estimated (View::effect); null: none. The standard deviations of their
  // groups are estimated too with kEstimatedNoise, and given otherwise.
  std::shared_ptr<const SharedEffects> effects;
  // Whether these standard deviations are kept away from zero, which the few effects of a group cannot prove
  // (solvers/uncertainty/variance_components.h, VarianceGroup::avoids_zero). Models are compared without that.
  bool effects_avoid_zero = true;
  // Is treated as an additional measurement of the free camera parameters.
  std::optional<CameraPrior> camera_prior;
  // One sigma of the target's scales about 1 (TargetShape), as additional measurements; nothing: they are not known.
  // The scale of the target and the size of an arm have nearly the same effect on the images.
  std::optional<double> target_scale_sigma;
  int max_iterations = 200;
  int num_threads = 1;  // The result does not depend on it.

  // Returns every violated constraint, one per line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

// Minimises the sum over all points of rho(|projection - observation|^2 / sigma^2) with Ceres, from `start` and
// problem.camera. `options` must be valid.
//
// The loss `truncated` means least squares over the points that pass their test at the resulting estimate; it starts
// from an estimate with the Cauchy loss. The other points are listed in ViewOutcome::rejected_ids and have no
// influence, even if they cannot be projected.
//
// Before the solve, the motion and the normal matrix at the start are examined: an unobservable direction is a
// Failure that names it. It is also a Failure if a target is behind the camera at the start (with `truncated`: in
// more than half of the views), if the refinement does not converge, or if the sigma of a result is too large for it
// to be useful.
//
// Without a prior, the covariance is sigma^2 times the inverse of the normal matrix of all free parameters, multiplied
// by the factor of the loss (solvers/residuals/loss.h). With a noisy robot, its corrections
// (solvers/uncertainty/robot_noise.h) are unknowns too, six per robot pose with the robot noise as their prior, and the
// covariance is marginalised over them. The effects are unknowns of the covariance, with their standard deviations as
// their priors.
Outcome<Solution> RefineHandEye(const Problem& problem, const HandEye& start, const BundleOptions& options);

}  // namespace heba
