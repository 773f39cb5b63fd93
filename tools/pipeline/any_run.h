// The run of a config, of one camera or of a rig.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "heba/base/error.h"
#include "heba/evaluation/run_result.h"
#include "tools/config/pair_config.h"
#include "tools/config/run_config.h"
#include "tools/text/console.h"

namespace heba {

using AnyConfig = std::variant<PairConfig, RunConfig>;

// Throws InputError on any error.
AnyConfig ReadAnyConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

inline const std::string& NameOf(const AnyConfig& any) {
  return std::visit([](const auto& config) -> const std::string& { return config.data.name; }, any);
}
// Returns the folder that the config names for the results.
inline const std::filesystem::path& OutputOf(const AnyConfig& any) {
  return std::visit([](const auto& config) -> const std::filesystem::path& { return config.output; }, any);
}

// Runs RunPipeline (tools/pipeline/pipeline.h).
Outcome<RunResult> RunAny(const AnyConfig& config, const std::filesystem::path& output, int num_threads,
                          Console* console, RunObserver* listener = nullptr);

// Returns the complete result in `output` if it was made from the same inputs; nothing otherwise, or if it cannot be
// read.
std::optional<RunResult> CurrentResult(const std::filesystem::path& output, const AnyConfig& config);

}  // namespace heba
