// The result of any number of cameras, targets and arms.
#pragma once

#include "tools/run/calibrated_images.h"
#include "tools/run/form_of_result.h"

namespace heba {

// Returns the part of the result of a calibration that only this form has. `used` has the points that the solution
// uses. The covariance of the calibration is the total one. Findings about arms whose kinematics are known name them.
FormOfResult CellForm(const ImageRun& run, const CalibratedImages& calibrated, const Problem& used);

// Returns a result with its errors by the truth. `problem` is the one that was solved.
RunResult WithTruth(RunResult result, const CellTruth& truth, const Problem& problem);

}  // namespace heba
