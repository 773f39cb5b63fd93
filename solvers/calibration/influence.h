// Influence of each capture on the result.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "solvers/residuals/loss.h"

namespace heba {

// Returns for each capture by how much the pose of a camera would move without it: one Gauss-Newton step from the
// solution over all other data, including an intrinsics prior (Cook and Weisberg 1982, section 3.2), with the noise of
// the solution and marginalised over the corrections of the arms. `problem` is what was solved, without the rejected
// points, and `loss` is its loss (`none` instead of `truncated`, because the outliers are already removed).
//
// The p-value of a move (CaptureMove::p_value) is computed from the covariance of the move, C_without - C_with (an
// informative capture has a large covariance of its move), with the degrees of freedom of the solution's noise.
// Returns nothing for a capture without points or without which the unknowns would not be observable, and for every
// capture if a point cannot be projected.
std::vector<std::optional<CaptureMove>> MoveWithoutEachCapture(const Problem& problem, const Solution& solution,
                                                               size_t camera, const Loss& loss);

}  // namespace heba
