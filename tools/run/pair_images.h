// Calibrates one camera, one target and one arm from the images of a data set.
#pragma once

#include <vector>

#include "heba/base/error.h"
#include "tools/run/calibrated_images.h"

namespace heba {

// Calibrates from the detections (CalibratePair), searches the images again for points that were missed, and takes in
// the errors of the arm, drifts, and motions of the camera. The parts of the result have no names. Throws Cancelled
// (tools/run/run_stage.h).
Outcome<CalibratedImages> CalibratePairImages(const ImageRun& run);

}  // namespace heba
