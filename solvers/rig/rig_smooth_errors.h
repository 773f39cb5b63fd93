// The search for errors of the arms' poses that vary smoothly with the pose, at a solution of a rig without them.
#pragma once

#include <cstddef>
#include <vector>

#include "heba/data/rig.h"
#include "heba/data/rig_solution.h"
#include "solvers/calibration/smooth_search.h"

namespace heba {

struct SmoothErrorsOfArm {
  size_t robot = 0;
  FoundSmoothErrors found;
};

// Returns the most likely smooth errors of each moving arm (MovingRobots) without errors of its own, each without those
// of the other arms. The problem has the points that were used. Returns none if a point cannot be projected.
std::vector<SmoothErrorsOfArm> FindSmoothErrorsOfArms(const RigProblem& problem, const RigSolution& solution);

}  // namespace heba
