// The result in the folder of a finished run.
#pragma once

#include <filesystem>

#include "heba/evaluation/run_result.h"

namespace heba {

// Returns the folder of a run that is named by its folder or by the result.json in it.
std::filesystem::path RunFolderOf(const std::filesystem::path& run);

// Returns the result in the folder of a run. Throws InputError if it cannot be read, or if that of a single camera has
// no refined estimate from images or corners.
RunResult ReadRefinedResult(const std::filesystem::path& folder);

}  // namespace heba
