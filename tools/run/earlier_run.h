// Builds a calibration on an earlier run of the same cell, whose result counts as an observation.
#pragma once

#include <vector>

#include "heba/evaluation/finding.h"
#include "heba/run_types.h"

namespace heba {

// Gives a data set and its options what the earlier run tells: the camera, if none is given, with the parts of its
// intrinsics that were unknown; the shape of the target, as it was modelled; the noise of the robot, if it is to be
// chosen; and the prior of the adjustment. Throws InputError, which begins with the name of the earlier run, if that
// run is of another kind of target or has a camera of another model or image size.
void BuildOn(const EarlierRun& earlier, PairDataset* dataset, PairRunOptions* options);
// Likewise for any number of cameras, targets and arms. The noise of the arms is estimated anew.
void BuildOn(const EarlierRun& earlier, Dataset* dataset, RunOptions* options);

// Gives a problem the shapes of targets that the earlier run found, and its prior. Targets that are read as there
// (ReadAsEarlier) have no symmetries any more. Throws InputError if the covariance of the earlier run is of no use.
void AddPrior(const EarlierRun& earlier, Problem* problem);

// Reads the targets with symmetries in the orders in which the earlier run saw them, so that their poses mean the same;
// if it lacks a camera or an arm, or targets were moved, nothing is changed, and the prior has no poses of targets.
void ReadAsEarlier(const EarlierRun& earlier, const Dataset& dataset, std::vector<TargetDetection>* detections);

// The finding `prior`: whether the captures agree with the earlier run. `used` has the points that the solution uses.
Finding JudgePrior(const EarlierRun& earlier, const Problem& used, const Solution& solution);

}  // namespace heba
