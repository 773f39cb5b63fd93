// Where the camera is mounted. The two set-ups are one equation:
//   camera_from_target = camera_from_camera_mount * camera_mount_from_target_mount * target_mount_from_target
// Eye-in-hand: the camera's mount is the gripper, the target's is the base. Eye-to-hand: the reverse. They differ in
// CameraMountFromTargetMount and in nothing else.
#pragma once

#include <optional>
#include <string_view>

#include "heba/geometry/rigid3.h"

namespace heba {

enum class Setup { kEyeToHand, kEyeInHand };

std::string_view SetupName(Setup setup);  // "eye_to_hand", "eye_in_hand"
std::optional<Setup> FindSetup(std::string_view name);

// "base" or "gripper".
std::string_view CameraMountName(Setup setup);
std::string_view TargetMountName(Setup setup);

// base_from_gripper (eye-to-hand) or its inverse (eye-in-hand).
Rigid3d CameraMountFromTargetMount(Setup setup, const Rigid3d& base_from_gripper);
// The inverse of the function above.
Rigid3d BaseFromGripper(Setup setup, const Rigid3d& camera_mount_from_target_mount);

}  // namespace heba
