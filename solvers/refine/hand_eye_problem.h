// The views of a hand-eye calibration as a problem with one camera, one target and one arm (heba/data/hand_eye.h).
#pragma once

#include "heba/adjustment_options.h"
#include "heba/data/hand_eye.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"

namespace heba {

// Returns the problem whose captures are the views, with one image each, and whose unknowns are those of the options.
// The world is the base of the arm.
Problem HandEyeProblem(const PairProblem& problem, const BundleOptions& options);

// Returns the poses of such a problem in their other form (HandEyePosesOf).
HandEye HandEyeOf(const CellPoses& poses);

// Returns a solution of such a problem in its other form (ProblemSolution). The effects are those of `options`.
PairSolution HandEyeSolution(const Solution& solution, const BundleOptions& options);

}  // namespace heba
