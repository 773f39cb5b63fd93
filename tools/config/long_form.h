// Keys of rigs that runs and scenes have.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/data/problem.h"

namespace heba {

// Returns whether a file has `cameras`, `targets` or `robots`.
bool HasLongForm(const ConfigValue& value);
// Returns the names of a section of named objects, in their order. `example` is a name for the message about a section
// without any. Throws InputError if a name has other characters than letters, digits, _ and -, or differs from another
// one by - and _ only: frames of ROS, which have no -, are called by these names.
std::vector<std::string> NamesIn(MapReader& reader, const std::string& example);
// Returns the names of the cameras. Throws InputError also for a name whose files would have the names of files with
// more than one camera.
std::vector<std::string> CameraNamesIn(MapReader& reader);
// Reads the key `mount`, and returns the text too.
std::pair<Mount, std::string> ReadMount(MapReader& reader, const std::vector<std::string>& robots);

}  // namespace heba
