// Calibrates any number of cameras, targets and arms from the images of a data set.
#pragma once

#include <vector>

#include "heba/base/error.h"
#include "tools/run/calibrated_images.h"

namespace heba {

// Calibrates from the detections (Calibrate), searches the images again for points that were missed, and takes in the
// drifts that are wanted or found. Throws Cancelled (tools/run/run_stage.h).
Outcome<CalibratedImages> CalibrateCell(const ImageRun& run);

// Returns the findings about held intrinsics, smooth errors beside those of an arm and weak directions, and the changes
// of the estimate that they make.
Advice AdviseOnCell(const ImageRun& run, const CalibratedImages& calibrated);

// Returns the options of the calibration of these arms.
CalibrationOptions CellOptions(const ImageRun& run, const std::vector<std::optional<ArmSetup>>& arms);

}  // namespace heba
