// Points that are where they should be, and the others.
#pragma once

#include <vector>

#include "heba/data/solution.h"

namespace heba {

// Of each point whether its squared residual, whitened and over sigma^2, passes the test of the loss `truncated`
// (solvers/residuals/loss.h). Points that were measured together (a block of Observations::covariances_px2) pass
// together or not at all. None passes if a point has no image from that pose.
std::vector<bool> FindInliers(const Camera& camera, const Rigid3d& camera_from_target, const Observations& observations,
                              double pixel_sigma_px);

// The observations that are to be kept, with all that is known of them. `keep`: one a point, alike within a block.
Observations KeepPoints(const Observations& observations, const std::vector<bool>& keep);

// The observations without the points of these ids.
Observations WithoutPoints(const Observations& observations, const std::vector<int>& ids);

// The problem without the points that a solution of all its views left out.
Problem WithoutRejected(const Problem& problem, const Solution& solution);

}  // namespace heba
