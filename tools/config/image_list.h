// The images that a config names.
#pragma once

#include <filesystem>
#include <vector>

#include "heba/config/yaml_reader.h"

namespace heba {

// Returns the images of a folder, a glob or a list, sorted by name unless it is a list. Throws InputError if there are
// none.
std::vector<std::filesystem::path> FindImages(const ConfigValue& value);
// Returns the value as used, with absolute paths.
YAML::Node ImagesNode(const ConfigValue& value, const std::vector<std::filesystem::path>& images);

}  // namespace heba
