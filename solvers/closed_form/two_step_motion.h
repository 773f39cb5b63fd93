// The motion of the two-step method (Fang et al. 2021): a home pose, one translation along the tool's x and one along
// its y without turning, turns about the tool point without moving it.
#pragma once

#include <string>
#include <vector>

#include "heba/data/problem.h"

namespace heba {

// The role of each view in such a motion, found from the robot's poses alone: home is the pose from which most others
// are pure translations along the tool's axes or pure turns about the tool point; "free" are those that are neither.
// All empty if the views have no home with both translations and two turns.
std::vector<std::string> FindTwoStepRoles(Setup setup, const std::vector<View>& views);

}  // namespace heba
