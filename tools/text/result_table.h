// Formats a run's result as tables for the terminal.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/run_result.h"
#include "tools/text/result_text.h"

namespace heba {

// Returns a table below the verdict, and the refined poses with their uncertainty. At most 80 columns wide, except for
// long texts. In the short form the table is that of the methods, closed-form and refined: `asked_for` are those that
// the config names, which are listed even if they do not suit the motion. Otherwise the table is that of the cameras;
// the poses are those of cameras, targets and arms, and those between cameras.
std::string ResultTable(const RunResult& result, Colour colour, const std::vector<std::string>& asked_for = {});

}  // namespace heba
