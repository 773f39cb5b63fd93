// What a run was made from, by content: whether its results still are what it would give.
#pragma once

#include <filesystem>
#include <string>

#include "tools/run_config.h"

namespace heba {

// The text of a run's inputs.json: digests of the program, of the config as used and of every file that it reads. Files
// that cannot be read have none.
std::string RunInputsText(const RunConfig& config);

// Whether `output` holds a complete result, made from the same.
bool HasCurrentResult(const std::filesystem::path& output, const RunConfig& config);

}  // namespace heba
