// The result of any number of cameras, targets and arms.
#pragma once

#include "tools/run/calibrated_images.h"
#include "tools/run/form_of_result.h"

namespace heba {

// Returns the part of the result of a calibration that only this form has. `used` has the points that the solution
// uses. The covariance of the calibration is the total one. Findings about arms whose kinematics are known name them.
FormOfResult CellForm(const ImageRun& run, CalibratedImages* calibrated, const Problem& used);

// Fills in the errors of a result by the truth. `problem` is the one that was solved.
void AddTruth(const CellTruth& truth, const Problem& problem, RunResult* result);

}  // namespace heba
