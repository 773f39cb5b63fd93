// Bundle adjustment of a problem: refines the poses of all cameras, targets and arms, the cameras' intrinsics and the
// targets' shapes jointly, by minimising the whitened reprojection error of every point in every image. A capture's
// error of an arm's pose is common to all its images. docs/estimation.md derives the cost and the covariance.
//
//   const heba::Outcome<heba::Solution> solution = heba::RefineProblem(problem, start, heba::AdjustmentOptions());
//   if (solution) {
//     for (const heba::RelativePose& pose : heba::RelativeCameraPoses(problem, *solution)) Use(pose);
//   }
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "heba/adjustment_options.h"
#include "heba/base/error.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"

namespace heba {

// Minimises the sum over all points of rho(|projection - observation|^2 / sigma^2) with Ceres, from `start` and the
// cameras and shapes of the problem; sigma is that of the point's camera. With noisy arms, the corrections of their
// poses are unknowns, six for each arm and each of its poses, with the arm's noise as their prior. The noise of the
// arms is estimated by restricted maximum likelihood (equation 11 of docs/estimation.md), and that of the camera with
// it, if there is one. The noise of each of several cameras is estimated from its residuals and their redundancy
// (Helmert's variance components; Foerstner, "Ein Verfahren zur Schaetzung von Varianz- und Kovarianzkomponenten",
// 1979). Errors of images as a whole are estimated if a capture has several images.
//
// Returns a Failure, in words, if a direction is unobservable, if an image has a point without a projection at the
// start (with the loss `truncated`: in more than half of the images), if the refinement does not converge, or if the
// sigma of a result is too large for it to be useful.
Outcome<Solution> RefineProblem(const Problem& problem, const CellPoses& start, const AdjustmentOptions& options);

// Returns the restricted log-likelihood (solvers/uncertainty/variance_components.h) of the problem's points at a
// solution. All parameters except the targets' shapes are taken as common to the models that are compared. Comparable
// between solutions of one problem whose points have the same weights. Returns minus infinity if a point cannot be
// projected.
double LogLikelihoodOf(const Problem& problem, const Solution& solution, const AdjustmentOptions& options);
// Likewise if the groups of the arms' effects that `smaller` lacks have at least the standard deviations that
// robots have (EffectGroup::least_sigma); it has one entry per arm, null for an arm whose groups stay as they are.
// Returns nothing if no such deviation is known.
std::optional<double> LogLikelihoodAtLeast(const Problem& problem, const Solution& solution,
                                           const AdjustmentOptions& options,
                                           const std::vector<std::shared_ptr<const SharedEffects>>& smaller);

}  // namespace heba
