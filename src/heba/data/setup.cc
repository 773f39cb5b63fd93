#include "heba/data/setup.h"

#include <array>
#include <cstddef>

#include "heba/base/registry.h"

namespace heba {

namespace {

constexpr std::array<std::string_view, 2> kSetupNames = {"eye_to_hand", "eye_in_hand"};  // In the order of Setup.

}  // namespace

std::string_view SetupName(Setup setup) { return kSetupNames[static_cast<size_t>(setup)]; }

std::vector<std::string> SetupNames() { return {kSetupNames.begin(), kSetupNames.end()}; }

std::optional<Setup> FindSetup(std::string_view name) { return FindValue<Setup>(kSetupNames, name); }

std::string_view CameraMountName(Setup setup) { return setup == Setup::kEyeToHand ? "base" : "gripper"; }
std::string_view TargetMountName(Setup setup) { return setup == Setup::kEyeToHand ? "gripper" : "base"; }

Rigid3d CameraMountFromTargetMount(Setup setup, const Rigid3d& base_from_gripper) {
  return setup == Setup::kEyeToHand ? base_from_gripper : Inverse(base_from_gripper);
}

Rigid3d BaseFromGripper(Setup setup, const Rigid3d& camera_mount_from_target_mount) {
  return setup == Setup::kEyeToHand ? camera_mount_from_target_mount : Inverse(camera_mount_from_target_mount);
}

}  // namespace heba
