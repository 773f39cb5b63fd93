// Runs the calibration of a data set of one camera, one target and one arm, with closed forms beside the estimate.
#pragma once

#include "heba/base/error.h"
#include "heba/run_types.h"

namespace heba {

// Detects the target in the images, calibrates, searches the images again for points that were missed, and assesses the
// result on held-out captures (docs/estimation.md). With `target_poses`, it calibrates from these poses. The verdict
// and what the data set leaves out are left to the caller (heba/run.h), which has checked the data set and built it on
// the earlier run. `observer` may be null. Throws what Run throws, and Cancelled (tools/run/run_stage.h).
Outcome<RunOutput> RunPair(const Dataset& dataset, const RunOptions& options, RunObserver* observer);

}  // namespace heba
