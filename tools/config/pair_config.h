// The config of a run of one camera, one target and one arm, read and checked, with the data set that it names.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "tools/config/pair_config_types.h"

namespace heba {

// Reads the config, the files that it is based on, and the files that they name, except for the images. `settings`
// (--set) take precedence over the files. Throws InputError on any error.
PairConfig ReadPairConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

// Reads the key `methods`: a list without repetitions, or `all`, the default, which is returned as an empty list.
std::vector<std::string> ReadMethods(MapReader& reader);

}  // namespace heba
