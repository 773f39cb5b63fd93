// Builds a calibration on an earlier run of the same cell, whose result counts as an observation.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/smooth_errors.h"
#include "heba/evaluation/finding.h"
#include "heba/run_types.h"

namespace heba {

// Return the parts of a camera, and of a target's shape, that a run estimated.
std::vector<ParameterGroup> FreeIntrinsicsOf(const RunResult& run, size_t camera);
std::vector<TargetShapeGroup> FreeShapeOf(const RunResult& run, size_t target);

// A data set and the options of its run with what an earlier run tells.
struct BuiltOnEarlier {
  Dataset dataset;
  RunOptions options;
};
// Returns them with the cameras that are not given, with the parts of their intrinsics that were unknown, and the
// shapes of the targets, as they were modelled. Throws InputError, which begins with the name of the earlier run, if
// that run has another kind of target, a camera of another model or image size, or nothing in common.
BuiltOnEarlier BuildOn(const EarlierRun& earlier, Dataset dataset, RunOptions options);

// The options of a run with the noise of the arm in an earlier run.
struct NoiseOfEarlier {
  RunOptions options;
  std::optional<SmoothErrors> smooth;  // The smooth errors of the arm, with the sigmas that they have there.
};
// Returns the options of the run of one camera, one target and one arm with the noise of the arm, if it is to be
// chosen. There are smooth errors if the earlier run has any and the run may have some: a few captures are near each
// other, and err alike. The noise of several arms is estimated anew.
NoiseOfEarlier BuildNoiseOn(const EarlierRun& earlier, const Dataset& dataset, RunOptions options);

// Returns a problem with the shapes of targets that the earlier run found, and its prior. Targets that are read as
// there (ReadAsEarlier) have no symmetries any more. Throws InputError if the covariance of the earlier run is of no
// use.
Problem WithPrior(Problem problem, const EarlierRun& earlier);

// Returns the detections of targets with symmetries in the orders in which the earlier run saw them, so that their
// poses mean the same; if it lacks a camera or an arm, or targets were moved, nothing is changed, and the prior has no
// poses of targets.
std::vector<TargetDetection> ReadAsEarlier(const EarlierRun& earlier, const Dataset& dataset,
                                           std::vector<TargetDetection> detections);

// The finding `prior`: whether the captures agree with the earlier run. `used` has the points that the solution uses.
Finding JudgePrior(const EarlierRun& earlier, const Problem& used, const Solution& solution);

}  // namespace heba
