// The smooth errors that a finished run states of its arms.
#pragma once

#include <optional>
#include <vector>

#include "heba/evaluation/run_result.h"
#include "heba/session_check.h"

namespace heba {

// Returns the smooth errors of each arm, with the distances over which they change; nothing for an arm without.
std::vector<std::optional<SmoothPrior>> SmoothPriorsOf(const RunResult& result);

}  // namespace heba
