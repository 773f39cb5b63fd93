// `heba detect --any`: which targets images show.
#pragma once

#include <string>
#include <vector>

namespace heba {

// Prints which targets the images show, as configs to paste with their sizes open, or as JSON. A folder stands for its
// images; of many images, a few are searched. Returns the exit status: kWorkFailed if no target is seen.
int DetectAny(const std::vector<std::string>& images);

}  // namespace heba
