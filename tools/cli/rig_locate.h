// The command locate with the result of a rig.
#pragma once

#include <string>
#include <vector>

namespace heba {

// Locates the targets that images of the rig's cameras (CAMERA=IMAGE) show together, or the point whose pixels --pixels
// gives, or each of these pixels on a plane (--plane). Returns the exit status. Throws InputError on wrong arguments.
//
// With --json, prints {"schema": "heba/rig_locations/1", "heba", "name", "robots"} with "targets", with "point":
// {"in_world_m", "rms_px", "warning", "sigma"}, or with "points": [{"camera", "pixel", "in_world_m", "sigma"}].
// "robots" has the pose of each arm that carries one of the cameras, {"stated", "corrected", "arm", "reason"}: `arm` is
// the model whose errors are estimated, `corrected` the pose without these errors, and `reason` states why it is not
// known. A target has {"target", "cameras", "located", "reason", "pose", "rms_px", "chance", "symmetries", "sigma",
// "poses", "chosen"}: `chance` is LocatedTarget::p_value; `poses` are all poses that fit, each {"pose", "near_deg",
// "near_mm", "sigma"}, and `chosen` is the index of the one that is meant, whose values are `pose` and `sigma`. A
// figure that does not exist is null.
int LocateWithRig(const std::vector<std::string>& arguments);

}  // namespace heba
