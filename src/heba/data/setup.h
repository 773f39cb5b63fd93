// The mounting of the camera. Both setups satisfy one equation:
//   camera_from_target = camera_from_camera_mount * camera_mount_from_target_mount * target_mount_from_target
// Eye-in-hand: the camera is mounted on the gripper, the target on the base. Eye-to-hand: the reverse. The setups
// differ in CameraMountFromTargetMount and in the names of the mounts only.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "heba/geometry/rigid3.h"

namespace heba {

enum class Setup { kEyeToHand, kEyeInHand };

std::string_view SetupName(Setup setup);  // "eye_to_hand", "eye_in_hand"
std::vector<std::string> SetupNames();    // The names of all setups.
std::optional<Setup> FindSetup(std::string_view name);

// Returns "base" or "gripper".
std::string_view CameraMountName(Setup setup);
std::string_view TargetMountName(Setup setup);

// Returns base_from_gripper (eye-to-hand) or its inverse (eye-in-hand).
Rigid3d CameraMountFromTargetMount(Setup setup, const Rigid3d& base_from_gripper);
// Returns base_from_gripper; the inverse of the function above.
Rigid3d BaseFromGripper(Setup setup, const Rigid3d& camera_mount_from_target_mount);

}  // namespace heba
