// Runs a whole calibration of a rig: from a data set (the images of its cameras and the poses of its arms) to a result
// with its errors, uncertainties and findings. This is all that `heba run` does with a rig between its config and its
// files.
#pragma once

#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/rig_run_types.h"

namespace heba {

// Detects, calibrates and assesses the result on held-out captures. `observer` may be null; it is told about the stages
// only. Returns a Failure if the result cannot be trusted, or if the run was cancelled. Throws InputError if the data
// set is incomplete or an image cannot be read.
Outcome<RigRunOutput> RunRig(const RigDataset& dataset, const RigRunOptions& options, RunObserver* observer = nullptr);

// Returns why two targets of a rig cannot be told apart in one image (Target::Codes), in words; empty if they can.
std::string WhyNotToldApart(const RigDataset& dataset);

}  // namespace heba
