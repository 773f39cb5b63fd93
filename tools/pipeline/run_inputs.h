// Records the inputs of a run by their contents, to tell whether its results are still current.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/rig_evaluation.h"
#include "tools/config/rig_config.h"
#include "tools/config/run_config.h"

namespace heba {

// Returns the text of a run's inputs.json: digests of the program, of the config as used and of every file that it
// reads. The digest of a file that cannot be read is empty.
std::string RunInputsText(const RunConfig& config);
std::string RunInputsText(const RigConfig& config);

// Return the complete result in `output` if it was made from the same inputs; nothing otherwise, or if it cannot be
// read.
std::optional<RunResult> CurrentResult(const std::filesystem::path& output, const RunConfig& config);
std::optional<RigResult> CurrentResult(const std::filesystem::path& output, const RigConfig& config);

}  // namespace heba
