// The motion of the two-step method (Fang et al. 2021): a home pose, one translation along the tool's x axis and one
// along its y axis without rotation, and rotations about the tool point without translation.
#pragma once

#include <string>
#include <vector>

#include "heba/data/pair_problem.h"

namespace heba {

// Returns the role of each view in such a motion, found from the robot poses alone. Home is the pose from which most
// other poses are pure translations along the tool's axes or pure rotations about the tool point; views that are
// neither have the role kFree. All roles are kNone if no pose is a home with both translations and two rotations.
std::vector<CaptureRole> FindTwoStepRoles(Setup setup, const std::vector<View>& views);

}  // namespace heba
