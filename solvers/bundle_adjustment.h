// The refinement: hand-eye pose, board pose and camera intrinsics together, by the whitened reprojection error of every
// point of every view.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/solution.h"

namespace heba {

struct BundleOptions {
  std::vector<ParameterGroup> free_intrinsics = {ParameterGroup::kFocal, ParameterGroup::kPrincipalPoint,
                                                 ParameterGroup::kDistortion};
  std::string loss = "huber";
  // One coordinate's noise. Nothing: estimated from the residuals.
  std::optional<double> pixel_noise_px;
  int max_iterations = 200;

  // Every violated constraint, one a line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

// Minimises the sum over all points of rho(|projection - observation|^2 / sigma^2) with Ceres, from `start` and
// problem.camera. Before the solve, the motion and the normal matrix at the start are examined: what the data cannot
// see is a Failure that names it. So are a target behind the camera at the start, no convergence, and a result whose
// own sigma says that it means nothing. The covariance is sigma^2 times the inverse of the normal matrix of all free
// parameters, with the loss's factor (solvers/loss.h).
Outcome<Solution> RefineHandEye(const Problem& problem, const HandEye& start, const BundleOptions& options);

}  // namespace heba
