// Calibrates again with the errors of the robot that captures share, if the captures require them: those of the arm's
// parameters, or errors of the poses that vary smoothly.
#pragma once

#include <optional>
#include <vector>

#include "heba/evaluation/finding.h"
#include "heba/run_types.h"
#include "tools/run/arm_setup.h"
#include "tools/run/captures.h"

namespace heba {

// A calibration of the captures, with what it knows of the robot's errors.
struct RobotCalibration {
  PairCalibration calibration;
  PairCalibrationOptions options;           // The final refinement used these.
  EffectsOfCaptures effects;                // The errors that captures share, at the captures.
  std::optional<ArmSetup> arm;              // Nothing if no arm is estimated; it states why its errors could not be.
  std::optional<Finding> of_smooth_errors;  // Smooth errors are part of the calibration if it has a value.
};

// Calibrates again, with the errors of the arm and the noise of its joints, or errors that vary smoothly with the pose,
// among what is estimated (CalibrateRobotErrors). `without` is the calibration without them, and is kept if they cannot
// be estimated or if the captures do not require them.
RobotCalibration CalibrateWithRobotErrors(const Dataset& dataset, const RunOptions& run, RobotCalibration without);

// The arm of a calibration from poses: its joints, or the reason why there are none, the errors among which is chosen,
// and the pairs with the effects of these errors.
struct ArmOfPairs {
  ArmSetup arm;
  PoseCalibrationOptions options;
  std::vector<PosePair> pairs;
};
// Returns the arm with the joints that the pairs of a calibration from poses show. `options` are those without an arm.
ArmOfPairs SetUpArmOfPairs(const Dataset& dataset, const RunOptions& run, ArmSetup arm,
                           const PoseCalibrationOptions& options, const PairCalibration& calibration);

}  // namespace heba
