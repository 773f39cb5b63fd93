// How much of a result hangs on each capture.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/solution.h"
#include "solvers/uncertainty/information.h"

namespace heba {

// For each view, what the hand-eye pose would move by without it: one Gauss-Newton step from the solution over all else
// that it rests on, an intrinsics prior included (Cook and Weisberg 1982, section 3.2), with the noise as the solution
// has it, the robot's averaged over. `problem` is what was solved, without the points that the solution left out, and
// `loss` its loss (`none` for `truncated`, whose others were left out). The chance of a move is by its own covariance,
// C_without - C_with (a capture that tells much moves much), with the degrees of freedom of the solution's noise.
// Nothing for a view without which the others could not tell the unknowns, or that tells nothing of the pose.
std::vector<std::optional<CaptureMove>> MoveWithoutEachView(const Problem& problem, const Solution& solution,
                                                            const FreeParameters& free, const Loss& loss);

}  // namespace heba
