// Reads the keys of a run's config in its long form, with `cameras`, `targets` and `robots`.
#pragma once

#include "heba/config/yaml_reader.h"
#include "tools/config/run_config_types.h"

namespace heba {

// Fills in the data set and the options from the keys that the long form alone has, from `captures` and from `refine`.
// Throws InputError on any error.
void ReadLongForm(MapReader& root, RunConfig* config);

}  // namespace heba
