// The arms whose dimensions are known: arms.def and ur_robots.def, with the limits of their joints (joint_limits.def).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "heba/robot/arm.h"

namespace heba {

// Returns all arms, Universal Robots' first.
const std::vector<Arm>& Arms();
std::vector<std::string> ArmNames();
// Returns null if there is no arm of that name.
const Arm* FindArm(std::string_view name);

}  // namespace heba
