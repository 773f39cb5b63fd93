// The run of a data set with images or detections.
#pragma once

#include "heba/base/error.h"
#include "heba/run_types.h"

namespace heba {

// Detects the targets in the images, calibrates, searches the images again for points that were missed, and assesses
// the result on held-out captures (docs/estimation.md). The offset of a stream's clock and the points of targets are
// estimated if that is wanted. The verdict and what the data set leaves out are left to the caller (heba/run.h), which
// has checked the data set and built it on the earlier run. `observer` may be null. Throws what Run throws, and
// Cancelled (tools/run/run_stage.h).
Outcome<RunOutput> RunOnImages(const Dataset& dataset, const RunOptions& options, RunObserver* observer);

}  // namespace heba
