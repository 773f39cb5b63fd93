// Captures that are judged together.
#pragma once

#include "solvers/refine/judged_problem.h"

namespace heba {

// Judges the captures by `judge`, and then all of them together. Captures come in clusters, as those of one
// configuration of an arm, whose errors an estimate cannot know that has seen none of them: each of them looks wrong by
// itself. If two or more images are left out, the problem is adjusted with all of them, the effects of the arms
// included, and judged from there. That selection is taken if it leaves out fewer images and explains the others: the
// noise of no arm rises by more than a factor of two.
JudgedProblem JudgeWithClusters(const Judge& judge, const Problem& problem, JudgedProblem at,
                                const AdjustmentOptions& options);

}  // namespace heba
