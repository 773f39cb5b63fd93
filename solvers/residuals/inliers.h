// Separation of inliers and outliers among the points of a view.
#pragma once

#include <vector>

#include "heba/data/pair_solution.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"

namespace heba {

// Returns for each point whether its squared residual, whitened and divided by sigma^2, passes the test of the loss
// `truncated` (solvers/residuals/loss.h). Points that were measured together (a block of
// Observations::covariances_px2) pass together or not at all. No point passes if any point cannot be projected from
// that pose.
std::vector<bool> FindInliers(const Camera& camera, const Rigid3d& camera_from_target, const Observations& observations,
                              double pixel_sigma_px);

// Returns the observations with `keep` set, together with their radii, covariances and whitening. `keep` has one flag
// per point, equal within a block.
Observations KeepPoints(const Observations& observations, const std::vector<bool>& keep);

// Returns the observations without the points with these ids.
Observations WithoutPoints(const Observations& observations, const std::vector<int>& ids);

// Return the problem without the points that `solution`, which must have an entry for every view, rejected.
PairProblem WithoutRejected(const PairProblem& problem, const PairSolution& solution);
Problem WithoutRejected(Problem problem, const Solution& solution);
// Returns a solution whose rejected points are also those that an earlier solution of the same captures rejected, and
// that were left out since.
Solution WithRejectedBefore(Solution solution, const Solution& before);

}  // namespace heba
