// Simulated rigs whose arms have errors of their kinematics, for the tests of their estimation.
#pragma once

#include <optional>
#include <vector>

#include "heba/calibration.h"
#include "heba/robot/arm_errors.h"
#include "heba/simulation/arm_captures.h"
#include "heba/simulation/arm_motion.h"
#include "tests/support/cell_scenes.h"

namespace heba {

struct CellArmScene {
  CellScene rig;
  std::vector<std::optional<SimulatedArm>> arms;
  std::vector<std::vector<Eigen::VectorXd>> joints;  // One list per capture.
};

// Two fixed cameras and one on the gripper, a target on the gripper and one that lies on the floor, where an arm
// reaches the poses from which its camera sees it. The scene has no captures.
CellScene ReachableCell(uint64_t seed, const CellSceneSetting& setting);

// Returns a rig with the captures of arms of this kind, whose parameters have errors of these sigmas (DrawArmErrors):
// those that captures determine, so that the poses of what stands in the base or is on the flange are the true ones.
CellArmScene WithArms(CellScene rig, const CellSceneSetting& setting, const ArmErrorSigmas& sigmas, uint64_t seed);

// Returns the errors of the arms among which a calibration may choose.
std::vector<ArmErrorModels> ErrorsOf(const CellArmScene& scene);

}  // namespace heba
