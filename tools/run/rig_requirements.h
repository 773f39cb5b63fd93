// The accuracy with which the cameras of a rig locate targets where the config requires one.
#pragma once

#include <vector>

#include "heba/data/rig.h"
#include "heba/data/rig_solution.h"
#include "heba/evaluation/rig_evaluation.h"
#include "heba/run_types.h"

namespace heba {

// Returns what is reached for each requirement and each camera that it concerns: the one that it names, or all. A
// position concerns the fixed cameras that see it, or all fixed cameras if none does. A camera on a gripper, and every
// camera if no position is required, is judged at its working point: the target in the image in which it has the median
// distance. `used` has the images and points that the solution uses.
std::vector<RigRequirement> ReachedInRig(const std::vector<PlacedRequirement>& requirements, const RigProblem& used,
                                         const RigSolution& solution);

}  // namespace heba
