// The result of `heba check` as JSON.
#pragma once

#include <string>

#include "heba/data/rig.h"
#include "heba/session_check.h"

namespace heba {

// Returns `decision` (holds or moved), `p_value`, `images`, the most likely change as `body`, `side` and `change` with
// its sigmas, the scatter of the points, and for each part the change that it may have made and the smallest one that
// would have been seen.
std::string CheckToJson(const RigProblem& rig, const SessionCheck& check);
// Returns `decision: undecided` with the reason.
std::string UndecidedToJson(const std::string& reason);

}  // namespace heba
