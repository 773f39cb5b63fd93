// Reads the keys of a run's config in its short form: of one camera, one target and one arm, which have no names.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "tools/config/run_config_types.h"

namespace heba {

// Reads the data set and the options from the keys that the short form alone has, from `captures` and from `refine`.
// `file` is that of the config. Throws InputError on any error.
RunConfig ReadShortForm(MapReader& root, const std::filesystem::path& file);

// Reads the key `methods`: a list without repetitions, or `all`, the default, which is returned as an empty list.
std::vector<std::string> ReadMethods(MapReader& reader);

}  // namespace heba
