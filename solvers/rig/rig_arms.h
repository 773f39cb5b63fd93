// The errors of the arms' kinematics in the calibration of a rig: the configuration of each arm, and the simplest model
// of its errors that the captures do not reject.
#pragma once

#include <vector>

#include "heba/rig_calibration.h"
#include "solvers/rig/rig_rejection.h"

namespace heba {

// Makes the errors of the arms part of a problem, and adjusts again, if the captures require them or if they are wanted
// without a choice (RigArmErrors). `judged` is the adjustment without them. Both are kept if no errors are estimated.
//
// The configuration of an arm is that of the largest restricted likelihood with the largest model. The models of all
// arms are then chosen together (ChooseModel, solvers/calibration/model_choice.h).
//
// Returns one entry for each arm that has models to choose from.
std::vector<RigArmChoice> AddArmErrors(const RigCalibrationOptions& options, RigProblem* problem, JudgedRig* judged);

}  // namespace heba
