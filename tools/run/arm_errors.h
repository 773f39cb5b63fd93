// The kinematics of the arms of a rig: their joints, the errors among which is chosen, and what a run says about them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/finding.h"
#include "heba/run_types.h"
#include "tools/run/arm_setup.h"

namespace heba {

// Returns the joints of each arm in all captures; nothing for arms whose kinematics are not known, and for all of them
// with Kinematics::kNone.
std::vector<std::optional<ArmSetup>> SetUpArms(const Dataset& dataset, Kinematics kinematics);
// Returns the errors of each arm among which is chosen, or those that were asked for; none for an arm without joints.
std::vector<ArmErrorModels> ErrorsOfArms(const Dataset& dataset, const std::vector<std::optional<ArmSetup>>& setups,
                                         Kinematics kinematics);

// The description of each arm, nothing if its kinematics are not known, and the findings about them.
struct ArmSummaries {
  std::vector<std::optional<RobotSummary>> arms;
  std::vector<Finding> findings;
};
// Describes the estimation of the arms' kinematics by a calibration whose adjustment succeeded. `setups` is that of
// SetUpArms.
ArmSummaries SummariseArms(const Dataset& dataset, std::vector<std::optional<ArmSetup>> setups, Kinematics kinematics,
                           const Calibration& calibration);

// Returns the findings; those about smooth errors of an arm whose kinematics are known have the name of the kinematics.
std::vector<Finding> WithNamesOfArms(std::vector<Finding> findings,
                                     const std::vector<std::optional<RobotSummary>>& arms,
                                     const std::vector<std::string>& robots);

}  // namespace heba
