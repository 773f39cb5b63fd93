// Calibrates again with the errors of the robot that captures share, if the captures require them: those of the arm's
// parameters, or errors of the poses that vary smoothly.
#pragma once

#include <optional>
#include <vector>

#include "heba/run_types.h"
#include "tools/run/arm_setup.h"
#include "tools/run/captures.h"

namespace heba {

// Calibrates again, with the errors of the arm and the noise of its joints, or errors that vary smoothly with the pose,
// among what is estimated (CalibrateRobotErrors). `calibration` is that without them, and is kept if they cannot be
// estimated or if the captures do not require them; `arm` then states the reason. It is null if no arm is known.
// `options` become those of the calibration that is kept, and `effects` what they are at the captures. Returns a
// finding if smooth errors are part of the calibration.
std::optional<Finding> CalibrateWithRobotErrors(const Dataset& dataset, const RunOptions& run, ArmSetup* arm,
                                                EffectsOfCaptures* effects, PairCalibrationOptions* options,
                                                PairCalibration* calibration);

// Sets the effects of the arm's errors on the pairs of a calibration from poses, and the errors among which is chosen.
void SetEffectsOfPairs(const Dataset& dataset, const RunOptions& run, ArmSetup* arm, PoseCalibrationOptions* options,
                       PairCalibration* calibration);

}  // namespace heba
