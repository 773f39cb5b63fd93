// The refinement: hand-eye pose, board pose and camera intrinsics together, by the whitened reprojection error of every
// point of every view.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/solution.h"
#include "solvers/uncertainty/information.h"
#include "solvers/uncertainty/variance_components.h"

namespace heba {

// What is known of the camera before: its parameters and one sigma of each, infinite where nothing is known.
struct CameraPrior {
  std::vector<double> params;
  std::vector<double> sigmas;
};

struct BundleOptions {
  std::vector<ParameterGroup> free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint,
                                                 ParameterGroup::kDistortion};
  // What of the target's shape is unknown too; the problem's (Problem::shape) is the start.
  std::vector<TargetShapeGroup> free_shape;
  std::string loss = "truncated";
  // One coordinate's noise. Nothing: estimated from the residuals.
  std::optional<double> pixel_noise_px;
  // The robot's poses are exact; are observations with the noise given; or with noise that is estimated together with
  // the pixels' (by restricted maximum likelihood).
  enum class Robot { kExact, kGivenNoise, kEstimatedNoise };
  Robot robot = Robot::kExact;
  RobotNoise robot_noise;  // For kGivenNoise.
  // For kEstimatedNoise: what is known of it before, where the captures are too few to tell it.
  std::optional<RobotNoisePrior> robot_noise_prior;
  // For kEstimatedNoise: where the search for it begins. By default a robot of the poorer kind.
  RobotNoise robot_noise_start = {1e-3, 2e-3};
  // Counts like further measurements of the parameters that are free.
  std::optional<CameraPrior> camera_prior;
  int max_iterations = 200;
  int num_threads = 1;  // The result does not depend on it.

  // Every violated constraint, one a line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

FreeParameters FreeOf(const CameraModel& model, const BundleOptions& options);

// The loss of the points that count: of `truncated`, once the others are left out, none.
const Loss& InlierLoss(const BundleOptions& options);

// Minimises the sum over all points of rho(|projection - observation|^2 / sigma^2) with Ceres, from `start` and
// problem.camera. With the loss `truncated` that is least squares of the points that pass their test at the estimate
// that they give, found from Cauchy's; the others are named in Solution::rejected_ids and count in nothing, not even if
// they have no image. Before the solve, the motion and the normal matrix at the start are examined: what the data
// cannot see is a Failure that names it. So are a target behind the camera at the start, no convergence, and a result
// whose own sigma says that it means nothing. The covariance is sigma^2 times the inverse of the normal matrix of all
// free parameters, with the loss's factor (solvers/residuals/loss.h); with a noisy robot its corrections
// (solvers/uncertainty/robot_noise.h) are unknowns too, six a view with the robot's noise as their prior, and the
// covariance is averaged over them.
Outcome<Solution> RefineHandEye(const Problem& problem, const HandEye& start, const BundleOptions& options);

// The restricted log-likelihood (solvers/uncertainty/variance_components.h) of the problem's points at a solution of
// it, of which the parameters beside the target's shape are common to all models. Comparable between solutions of one
// problem whose points have the same weights. Minus infinity if a point has no image.
double LogLikelihoodOf(const Problem& problem, const Solution& solution, const BundleOptions& options);

}  // namespace heba
