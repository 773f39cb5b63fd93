// The verdict on a result: findings with their grades, as codes and figures.
#pragma once

#include "heba/evaluation/run_result.h"

namespace heba {

// Judges a result from the point of view of a person who grasps with it, by its worst camera, which the finding names
// if it has a name: by the uncertainty of the cameras, by the distance between the targets and their predicted
// positions on held-out captures, by how well the noise model explains these, by the number of images that a camera
// uses and that it had to leave out, by its dependence on a single capture, and by RunResult::observations.
// Requirements of a camera (RunResult::requirements) replace the built-in limits on its uncertainty and hold-out
// errors. Each cause gives one finding, whose first part is its worst consequence. The texts of findings are neither
// set nor read.
Verdict JudgeRun(const RunResult& result);
// Judges the refined estimate likewise, and by a comparison with the closed forms. A result without one, from poses of
// the target, is judged by FindFinal.
Verdict JudgeRun(const PairResult& result);

// Returns the estimate that stands for the whole result: the refined one. A run on poses of the target has none: there
// it is the chain, unless the least-squares form of the two-step method predicts held-out captures clearly better,
// whose rotation and translation are estimated one after the other. Null if there is no estimate.
const Estimate* FindFinal(const PairResult& result);

}  // namespace heba
