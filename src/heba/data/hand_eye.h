// A hand-eye calibration in the form of several cameras, targets and arms: one of each, without names.
#pragma once

#include "heba/data/rig.h"
#include "heba/data/rig_solution.h"
#include "heba/data/setup.h"
#include "heba/data/solution.h"

namespace heba {

// Returns the arm, the camera and the target of a setup, without captures. The world is the base of the arm.
RigProblem HandEyeProblem(Setup setup, const Camera& camera, const TargetShape& shape);
// Returns the problem of a solution, with the effects that it has estimated and without captures.
RigProblem HandEyeProblem(Setup setup, const Solution& solution);

RigPoses HandEyePosesOf(const HandEye& hand_eye);
// Returns a solution as that of such a problem.
RigSolution ProblemSolution(const Solution& solution);

}  // namespace heba
