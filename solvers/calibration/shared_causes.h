// What captures that were left out share, so that they have one cause in place of a wrong pose each.
#pragma once

#include <string>
#include <vector>

#include "heba/data/pair_problem.h"
#include "heba/data/setup.h"

namespace heba {

// Returns, for each view that was left out, the clause of a cause that it shares with others; empty for one by itself.
// Views share a cause if three or more of them follow one another in time without a used one between them, or if three
// or more of them lie beside each other: of each, the two nearest poses (m, and rad at half a metre) are left out, too.
// Such views are those of a motion of camera or target, of a configuration of the arm, or of a part of its workspace.
std::vector<std::string> SharedCauses(Setup setup, const std::vector<View>& left_out, const std::vector<View>& used);

}  // namespace heba
