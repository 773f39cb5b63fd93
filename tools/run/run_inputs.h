// What a run was made from, by content: whether its results still are what it would give.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "heba/evaluation/evaluation.h"
#include "tools/config/run_config.h"

namespace heba {

// The text of a run's inputs.json: digests of the program, of the config as used and of every file that it reads. Files
// that cannot be read have none.
std::string RunInputsText(const RunConfig& config);

// The complete result that `output` holds, if it was made from the same; nothing otherwise, or if it cannot be read.
std::optional<RunResult> CurrentResult(const std::filesystem::path& output, const RunConfig& config);

}  // namespace heba
