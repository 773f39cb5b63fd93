// Assesses a calibration: every figure of a run's result except its timing, and the findings.
#pragma once

#include <optional>
#include <vector>

#include "heba/run_types.h"
#include "solvers/calibration/held_out.h"
#include "tools/run/captures.h"

namespace heba {

// Returns one estimate per method, then those of chain and bundle, each with its errors. `symmetries`: those of the
// target (Target::Symmetries).
std::vector<Estimate> MakeEstimates(Setup setup, const PairCalibration& calibration,
                                    const std::vector<HoldOut>& hold_outs, const std::optional<Truth>& truth,
                                    const std::vector<Rigid3d>& symmetries);

// Sets the errors of the captures that were left out in the figures of one camera or of one of several.
template <class ErrorFigures>
void SetLeftOut(const HeldOutErrors& left_out, ErrorFigures* figures) {
  if (!left_out.has_hidden) figures->left_out_rms_px = left_out.pixels.RmsPx();
  if (const std::optional<double> distance_m = left_out.RmsDistanceM()) {
    figures->left_out_target_mm = 1000 * *distance_m;
  }
}

// Assesses a calibration whose refinement succeeded, including cross-validation. The verdict is left to the caller
// (heba/evaluation/verdict.h). `options` and `effects` are those of the calibration, `detections` those that it used.
// `advice` is that of the calibration, whose covariance does not have its changes yet: those of the result have them.
RunResult Assess(const Dataset& dataset, const RunOptions& run, const std::vector<TargetDetection>& detections,
                 const EffectsOfCaptures& effects, const PairCalibration& calibration, const Advice& advice,
                 PairCalibrationOptions options, RunObserver* observer);

// Assesses a calibration from the data set's poses of the target (CalibratePoses) in the same way, as far as this is
// possible without images.
RunResult AssessPoses(const Dataset& dataset, const RunOptions& run, const PairCalibration& calibration,
                      PoseCalibrationOptions options);

}  // namespace heba
