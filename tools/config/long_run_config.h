// Reads the keys of a run's config in its long form, with `cameras`, `targets` and `robots`.
#pragma once

#include <filesystem>

#include "heba/config/yaml_reader.h"
#include "tools/config/run_config_types.h"

namespace heba {

// Reads the data set and the options from the keys that the long form alone has, from `captures` and from `refine`.
// `file` is that of the config. Throws InputError on any error.
RunConfig ReadLongForm(MapReader& root, const std::filesystem::path& file);

}  // namespace heba
