// Rejects captures that contradict the others, unless the model rather than the captures is wrong.
#pragma once

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/refinement.h"
#include "solvers/refine/judged_problem.h"

namespace heba {

// A larger share of the captures is rejected only if no other explanation fits better.
inline constexpr double kMostWrong = 0.25;
// Captures whose errors are larger than the others' by this factor belong to another population.
inline constexpr double kDistinct = 5;

// Tests the captures (FindOutlierCaptures) at `solution`, adjusts without those that are wrong, and tests all captures
// again, rejected ones included, until nothing changes. `options` are those of the solution (loss `truncated`, exact
// robot), whose problem has free shape parameters of the target. If more than kMostWrong of the captures would be
// rejected, two explanations are compared: one robot noise for all captures, or two, with a larger one for the captures
// that would be rejected. They are rejected only if two noises are more likely by more than the cost of choosing the
// captures, and differ by a factor of kDistinct, because the tail of one population is not another population. If most
// captures would be rejected, all are kept: none of several calibrations can be shown to be the right one.
JudgedProblem JudgeCaptures(const Problem& problem, const Solution& solution, const AdjustmentOptions& options);

}  // namespace heba
