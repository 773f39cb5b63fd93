// The run of a data set that has poses of the target in place of images.
#pragma once

#include "heba/base/error.h"
#include "heba/run_types.h"

namespace heba {

// Calibrates one camera, one target and one arm from the poses of the target that others estimated
// (Dataset::target_poses), with the evaluation that is possible without images. The verdict and what the data set
// leaves out are left to the caller (heba/run.h), which has checked the data set. `observer` may be null.
Outcome<RunOutput> RunOnPoses(const Dataset& dataset, const RunOptions& options, RunObserver* observer);

}  // namespace heba
