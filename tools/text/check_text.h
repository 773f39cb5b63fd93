// Words the result of `heba check`.
#pragma once

#include <string>
#include <string_view>

#include "heba/base/error.h"
#include "heba/data/problem.h"
#include "heba/session_check.h"

namespace heba {

// Returns "holds" or "moved".
std::string_view DecisionOf(const SessionCheck& check);
// Returns the side that the part of a change is on: "hand" or "world"; empty for a lens.
std::string_view SideOf(const Problem& rig, const SessionChange& change);
// Returns the part of a change, such as "the camera" or "the lens of camera left".
std::string PartText(const Problem& rig, const SessionChange& change);
// Returns whether the images tell the most likely change from another one: its likelihood is e^2 times larger.
bool IsToldFrom(const SessionChange& likely, const SessionChange& other);

// Returns why a check has no decision, in words.
std::string UndecidedText(const Failure& failure);
// Returns what has changed, with its size and sigma, as one clause; `check` must have found a change.
std::string ChangeText(const Problem& rig, const SessionCheck& check);
// Returns the decision with its evidence, and the smallest changes that would have been seen.
std::string CheckText(const Problem& rig, const SessionCheck& check);

}  // namespace heba
