// The result of a finished run, of one camera or of a rig.
#pragma once

#include <filesystem>
#include <variant>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/run_result.h"

namespace heba {

using AnyResult = std::variant<PairResult, RunResult>;

// Reads a result.json. Throws InputError if it cannot be read.
AnyResult ReadAnyResult(const std::filesystem::path& file);

inline const Verdict& VerdictOf(const AnyResult& any) {
  return std::visit([](const auto& result) -> const Verdict& { return result.verdict; }, any);
}

}  // namespace heba
