// The statements of a run about the arm: its estimated kinematics, or the reason why they were not estimated.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/run.h"
#include "tools/run/arm_setup.h"

namespace heba {

// Describes the estimation of the arm's kinematics. `setup` is empty if none was wanted.
RobotSummary SummariseArm(const Dataset& dataset, Kinematics kinematics, const std::optional<ArmSetup>& setup,
                          const Calibration& calibration);

// Returns the reason why the chosen model has no systematic errors of the robot, from the models that were compared.
std::string WhyDeclined(const Calibration& calibration);

// Returns what is to be said about it. `calibration` is the one that estimated the arm.
std::vector<Finding> FindingsOf(const RobotSummary& robot, const Dataset& dataset, const Calibration& calibration);

// Returns the finding about captures at or close to a singularity of the arm, if there are any. It is doubtful if the
// arm was estimated from joints that were recovered there.
std::optional<Finding> FindSingularCaptures(const Dataset& dataset, const ArmSetup& setup, bool is_estimated);

}  // namespace heba
