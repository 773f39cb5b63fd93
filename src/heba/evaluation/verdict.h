// The verdict on a result: findings with their grades, as codes and figures.
#pragma once

#include "heba/evaluation/evaluation.h"

namespace heba {

// Judges the refined estimate from the point of view of a person who grasps with it: by its uncertainty, by the
// distance between the target and its predicted position on held-out captures, by how well its noise model explains
// these, by the number of captures that it uses and that it had to leave out, by its dependence on a single capture, by
// a comparison with the closed forms, and by PairResult::observations. If the result states requirements
// (PairResult::requirements), they replace the built-in limits on uncertainty and hold-out errors. Each cause gives one
// finding, whose first part is its worst consequence. The texts of findings are neither set nor read.
Verdict JudgeRun(const PairResult& result);

// Returns the estimate that stands for the whole result: the refined one. A run on poses of the target has none: there
// it is the chain, unless the least-squares form of the two-step method predicts held-out captures clearly better,
// whose rotation and translation are estimated one after the other. Null if there is no estimate.
const Estimate* FindFinal(const PairResult& result);

}  // namespace heba
