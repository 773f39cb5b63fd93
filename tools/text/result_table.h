// A run's result as a table for the terminal.
#pragma once

#include <string>

#include "heba/evaluation/evaluation.h"

namespace heba {

enum class Colour { kPlain, kAnsi };

// Method by method, closed forms and refined, with what the result is worth below. At most 80 columns wide.
std::string ResultTable(const RunResult& result, Colour colour);

}  // namespace heba
