// Which target images show, where the run's own is not seen or none has been stated.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace heba {

// Returns the keys of the target that a few of these images show, as one line of a config with its size open; empty if
// none is seen. That takes a second or more. Throws InputError if an image cannot be read.
std::string ShownTarget(const std::vector<std::filesystem::path>& images, int num_threads);

}  // namespace heba
