// Words on located targets and pixels, on the true pose of an arm whose errors are estimated, and on what the gripper
// reaches.
#pragma once

#include <string>
#include <vector>

#include "tools/run/image_location.h"

namespace heba {

// Returns what the world is called: "base" for a single camera, "world" for several.
std::string WorldName(const Problem& rig);

// Describes what the images of one moment show; lists all possible poses of a target if none is chosen. Empty if
// nothing is located.
std::string LocationText(const LocationRequest& request, const ImageLocation& location);

// Returns why a target is not located, or why none of its possible poses is chosen, as "target NAME: ..." if it has a
// name; empty if one is.
std::string TargetFault(const LocationRequest& request, const TargetLocation& location);
// Returns why something is not located. A target of which the images show too little is no fault beside others, like
// one that they do not show.
std::vector<std::string> LocationFaults(const LocationRequest& request, const ImageLocation& location);

}  // namespace heba
