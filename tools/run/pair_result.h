// The result of one camera, one target and one arm, with the estimates of the closed forms.
#pragma once

#include <optional>
#include <vector>

#include "heba/evaluation/finding.h"
#include "heba/run_types.h"
#include "tools/run/arm_errors.h"
#include "tools/run/arm_setup.h"
#include "tools/run/calibrated_images.h"
#include "tools/run/form_of_result.h"

namespace heba {

// Returns the part of the result of a calibration that only this form has, including cross-validation; its poses and
// errors are set by WithFinalEstimate. The covariance of the calibration is the total one.
FormOfResult PairForm(const ImageRun& run, const CalibratedImages& calibrated);

// Returns the result of a calibration from the data set's poses of the target (CalibratePoses), without its findings.
RunResult AssessPoses(const Dataset& dataset, const RunOptions& run, const PairCalibration& calibration,
                      PoseCalibrationOptions options);

// Describes the only arm, whose kinematics are known. `setup`: nothing if its errors are not estimated.
ArmSummaries SummariseOnlyArm(const Dataset& dataset, Kinematics kinematics, const std::optional<ArmSetup>& setup,
                              const PairCalibration& calibration);

CalibratedPair AsPair(PairCalibration calibration);

// Returns a run with a refined estimate whose parts have the names of those of the data set.
RunOutput WithNames(RunOutput output);

}  // namespace heba
