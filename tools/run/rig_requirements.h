// The accuracy with which the cameras of a rig locate targets where the config requires one.
#pragma once

#include <vector>

#include "heba/data/rig.h"
#include "heba/data/rig_solution.h"
#include "heba/evaluation/rig_evaluation.h"
#include "heba/run.h"

namespace heba {

// Returns what is reached for each requirement and each camera that it concerns: the one that it names, or all.
// Positions concern the fixed cameras that see them, or all fixed cameras if none does; a camera that an arm carries
// can see a target at any position as where it saw one, and so does every camera without positions: in the image in
// which the target has the median distance. `used` has the images and points that the solution uses.
std::vector<RigRequirement> ReachedInRig(const std::vector<PlacedRequirement>& requirements, const RigProblem& used,
                                         const RigSolution& solution);

}  // namespace heba
