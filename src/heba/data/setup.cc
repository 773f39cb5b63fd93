#include "heba/data/setup.h"

namespace heba {

std::string_view SetupName(Setup setup) { return setup == Setup::kEyeToHand ? "eye_to_hand" : "eye_in_hand"; }

std::optional<Setup> FindSetup(std::string_view name) {
  for (const Setup setup : {Setup::kEyeToHand, Setup::kEyeInHand}) {
    if (SetupName(setup) == name) return setup;
  }
  return std::nullopt;
}

std::string_view CameraMountName(Setup setup) { return setup == Setup::kEyeToHand ? "base" : "gripper"; }
std::string_view TargetMountName(Setup setup) { return setup == Setup::kEyeToHand ? "gripper" : "base"; }

Rigid3d CameraMountFromTargetMount(Setup setup, const Rigid3d& base_from_gripper) {
  return setup == Setup::kEyeToHand ? base_from_gripper : Inverse(base_from_gripper);
}

Rigid3d BaseFromGripper(Setup setup, const Rigid3d& camera_mount_from_target_mount) {
  return setup == Setup::kEyeToHand ? camera_mount_from_target_mount : Inverse(camera_mount_from_target_mount);
}

}  // namespace heba
