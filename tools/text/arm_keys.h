// The keys of an arm in the config of a rig, for messages.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace heba {

// The name of the arm of a rig whose config has no list of arms (`robots`).
inline constexpr const char* kOnlyArm = "robot";

// Returns what the keys of the arm of a single camera, such as robot.model and captures.joints, are called in the
// config of a rig whose arm has this section, such as robots.left. Nothing if they are the same, as in the section
// captures.
std::vector<std::pair<std::string, std::string>> ArmKeys(const std::string& section);

// Returns a text with the keys of the arm of a single camera replaced by those of the arm of a rig with this name. A
// text that has the keys of the rig already does not change.
std::string WithArmKeys(const std::string& text, const std::string& robot);

}  // namespace heba
