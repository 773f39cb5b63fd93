// The command locate with the result of a rig.
#pragma once

#include <string>
#include <vector>

namespace heba {

// Locates the targets that images of the rig's cameras (CAMERA=IMAGE) show together, or the point whose pixels --pixels
// gives. Returns the exit status. Throws InputError on wrong arguments.
int LocateWithRig(const std::vector<std::string>& arguments);

}  // namespace heba
