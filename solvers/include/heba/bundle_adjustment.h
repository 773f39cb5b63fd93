// Bundle adjustment: refines hand-eye pose, board pose and camera intrinsics jointly, by minimising the whitened
// reprojection error of every point in every view. docs/estimation.md derives the cost and the covariance.
//
//   heba::BundleOptions options;
//   options.robot = heba::BundleOptions::Robot::kEstimatedNoise;
//   const heba::Outcome<heba::PairSolution> solution =
//       heba::RefineHandEye({camera, views, setup}, start, options);
//   if (solution) Use(solution->hand_eye, solution->covariance);
#pragma once

#include "heba/adjustment_options.h"
#include "heba/base/error.h"
#include "heba/data/pair_solution.h"

namespace heba {

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
Outcome<PairSolution> RefineHandEye(const PairProblem& problem, const HandEye& start, const BundleOptions& options);

}  // namespace heba
