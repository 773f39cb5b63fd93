// The result of `heba check` as JSON.
#pragma once

#include <string>

#include "heba/data/problem.h"
#include "heba/session_check.h"

namespace heba {

// Returns `decision` (holds or moved), `p_value`, `images`, of a move the most likely change as `body` and `change`,
// with its side and sigmas, the scatter of the points, and for each part the change that it may have made and the
// smallest one that would have been seen.
std::string CheckToJson(const Problem& rig, const SessionCheck& check);
// Returns `decision: undecided` with the reason.
std::string UndecidedToJson(const std::string& reason);

}  // namespace heba
