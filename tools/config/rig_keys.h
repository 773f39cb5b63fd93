// Keys of rigs that runs and scenes have.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/data/rig.h"

namespace heba {

// Returns whether a file has `cameras`, `targets` or `robots`.
bool HasRigKeys(const ConfigValue& value);
// Returns the names of a section of named objects, in their order. `example` is a name for the message about a section
// without any. Throws InputError if a name has other characters than letters, digits, _ and -.
std::vector<std::string> NamesIn(MapReader& reader, const std::string& example);
// Reads the key `mount`, and returns the text too.
std::pair<Mount, std::string> ReadMount(MapReader& reader, const std::vector<std::string>& robots);

}  // namespace heba
