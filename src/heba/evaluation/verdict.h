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
//
// The refined estimate of a result that has those of several methods is compared with the closed forms, too. A result
// of the short form without a refined estimate, from poses of the target, is judged by FindFinal.
Verdict JudgeRun(const RunResult& result);

}  // namespace heba
