// Formats a run's result as tables for the terminal.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/run_result.h"
#include "tools/text/result_text.h"

namespace heba {

// Return tables below the verdict, and the refined poses with their uncertainty. At most 80 columns wide, except for
// long texts.

// The table is that of the methods, closed-form and refined. `asked_for`: the methods that the config names, which are
// listed even if they do not suit the motion.
std::string ResultTable(const PairResult& result, Colour colour, const std::vector<std::string>& asked_for = {});
// The table is that of the cameras; the poses are those of cameras, targets and arms, and those between cameras.
std::string ResultTable(const RunResult& result, Colour colour);

}  // namespace heba
