// Words on the true pose of an arm whose errors are estimated, and on what the gripper reaches.
#pragma once

#include <string>

#include "heba/data/stated_pose.h"
#include "heba/evaluation/evaluation.h"
#include "heba/target_location.h"

namespace heba {

// Formats a covariance as "sx, sy, sz mm (calibration ...; image ...; robot ...)".
std::string SigmasText(const PositionCovariance& covariance);

// Returns a line on the correction of the pose that the robot states.
std::string CorrectionText(const RobotSummary& robot, const Solution& solution, const StatedPose& stated);

// Returns lines on the pose to command so that the gripper truly reaches the pose of a located target, with the
// uncertainty of its position there. `all_configurations`: also for the configurations in which no capture is; the
// lines then say so. They state all configurations if those of the captures are several.
std::string ReachText(const RobotSummary& robot, const Solution& solution, const LocatedTarget& located,
                      bool all_configurations);

}  // namespace heba
