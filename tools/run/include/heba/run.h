// Runs a whole calibration: from a data set (images or detections of any number of cameras and targets, and the poses
// of the arms) to a result with its errors, uncertainties and findings. This is all that `heba run` does between its
// config and its files. heba/pair_run.h has the same for one camera, one target and one arm.
#pragma once

#include <string>

#include "heba/base/error.h"
#include "heba/pair_run.h"
#include "heba/run_types.h"

namespace heba {

// Detects, calibrates and assesses the result on held-out captures. `observer` may be null; it is told about the stages
// only. A data set of one camera, one target and one arm gives the result of that pair. Returns a Failure if the result
// cannot be trusted, or if the run was cancelled. Throws InputError if the data set is incomplete or an image cannot be
// read.
Outcome<RunOutput> Run(const Dataset& dataset, const RunOptions& options, RunObserver* observer = nullptr);

// Returns why two targets of a data set cannot be told apart in one image (Target::Codes), in words; empty if they can.
std::string WhyNotToldApart(const Dataset& dataset);

}  // namespace heba
