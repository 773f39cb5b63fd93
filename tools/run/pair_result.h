// The result of one camera, one target and one arm, with the estimates of the closed forms.
#pragma once

#include <optional>
#include <vector>

#include "heba/evaluation/finding.h"
#include "heba/run_types.h"
#include "tools/run/arm_setup.h"
#include "tools/run/calibrated_images.h"
#include "tools/run/form_of_result.h"

namespace heba {

// Returns the part of the result of a calibration that only this form has, including cross-validation; its poses and
// errors are set by WithFinalEstimate. The calibration of the pair gets the covariance of the general one.
FormOfResult PairForm(const ImageRun& run, CalibratedImages* calibrated);

// Returns the result of a calibration from the data set's poses of the target (CalibratePoses), without its findings.
RunResult AssessPoses(const Dataset& dataset, const RunOptions& run, const PairCalibration& calibration,
                      PoseCalibrationOptions options);

// Adds the arm to a result and returns what is to be said of it. `setup`: nothing if its kinematics are not estimated.
std::vector<Finding> AddArm(const Dataset& dataset, Kinematics kinematics, const std::optional<ArmSetup>& setup,
                            const PairCalibration& calibration, RunResult* result);

CalibratedPair AsPair(PairCalibration calibration);

// Gives the parts of a run with a refined estimate the names that they have in the data set.
void NameParts(RunOutput* output);

}  // namespace heba
