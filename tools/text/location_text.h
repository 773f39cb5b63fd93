// Words on located targets and pixels, on the true pose of an arm whose errors are estimated, and on what the gripper
// reaches.
#pragma once

#include <string>

#include "tools/run/image_location.h"

namespace heba {

// Why there is no pose to command if the errors of the arm are estimated, but not those of the pose of the camera.
inline constexpr const char* kNoCommandReason = "the target was located with a pose that was not corrected";

// Returns "2 possible poses, from which it is 144, 3.2 mm and 178, 3.1 deg away".
std::string NearnessText(const NearPoses& near);
// Returns why a rough pose does not decide between the poses that fit.
std::string NearFault(const NearPoses& near);

// Describes where an image shows the target, or pixels; lists all possible poses if none is chosen. Empty if nothing is
// located.
std::string LocationText(const LocationRequest& request, const ImageLocation& location);

// Returns why nothing is located in an image, or why LocationRequest::near does not decide between the possible poses;
// empty otherwise.
std::string LocationFault(const ImageLocation& location);

}  // namespace heba
