// A run's config, read and checked, with the data set that it names.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "heba/run.h"
#include "tools/config/run_config_types.h"

namespace heba {

// Reads the config, in its short or its long form, the files that it is based on, and the files that they name, except
// for the images. `settings` (--set) take precedence over the files. Throws InputError on any error.
RunConfig ReadRunConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});
// Likewise, but refuses the long form.
RunConfig ReadShortRunConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

// Returns whether a config has the long form: whether it has `cameras`, `targets` or `robots`. Throws InputError if it
// cannot be read.
bool IsLongConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

}  // namespace heba
