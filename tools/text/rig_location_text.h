// Words on targets that the cameras of a rig locate together.
#pragma once

#include <string>
#include <vector>

#include "tools/run/rig_image_location.h"

namespace heba {

// Describes the pose of a located target, or all possible poses if none is chosen; empty if it is not located.
std::string RigLocationText(const RigProblem& rig, const RigTargetLocation& location);

// Returns why a target is not located, or why none of its possible poses is chosen, as "target NAME: ..."; empty if one
// is.
std::string RigLocationFault(const RigProblem& rig, const RigTargetLocation& location);
// Describes a located point, without the end of the line.
std::string RigPointText(const LocatedPoint& point);

// Returns a line for each arm with estimated errors that carries one of the cameras: how they corrected its pose, or
// why they did not; empty if there is none.
std::string ArmPosesText(const RigResult& result, const std::vector<RigArmPose>& arms);

}  // namespace heba
