// The run of a rig with one camera, one target and one arm, which is that of a single camera: with closed forms, a
// choice among all models of the errors, and the same hold-outs and findings.
#pragma once

#include "heba/base/error.h"
#include "heba/pair_run_types.h"
#include "heba/run_types.h"

namespace heba {

// Returns whether a data set has one camera and one target, which its only arm moves against each other.
bool IsSinglePair(const Dataset& dataset);

// Runs such a data set (heba/pair_run.h). The result lacks what Dataset::left_out and Dataset::truth add to it.
Outcome<RunOutput> RunSinglePair(const Dataset& dataset, const RunOptions& options, RunObserver* observer);

}  // namespace heba
