// Formats a run's result as a table for the terminal.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "tools/text/result_text.h"

namespace heba {

// Returns a table of the methods, closed-form and refined, below the verdict, followed by the refined pose and its
// uncertainty. At most 80 columns wide, except for long texts. `asked_for`: the methods that the config names, which
// are listed even if they do not suit the motion.
std::string ResultTable(const RunResult& result, Colour colour, const std::vector<std::string>& asked_for = {});

}  // namespace heba
