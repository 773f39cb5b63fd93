// Assesses a calibration: every figure of a run's result except its timing, and the findings.
#pragma once

#include <optional>
#include <vector>

#include "heba/evaluation/evaluation.h"
#include "solvers/calibration/calibration.h"
#include "solvers/calibration/cross_validation.h"
#include "targets/detection.h"
#include "tools/config/run_config.h"
#include "tools/text/console.h"

namespace heba {

// Returns one estimate per method, then those of chain and bundle, each with its errors. `symmetries`: those of the
// target (Target::Symmetries).
std::vector<Estimate> MakeEstimates(const Calibration& calibration, const std::vector<HoldOut>& hold_outs,
                                    const std::optional<Truth>& truth, const std::vector<Rigid3d>& symmetries);

// Predicts the target's points in a capture, px, from the calibration; nothing for points out of view.
std::vector<std::optional<Eigen::Vector2d>> ExpectedPixels(const Target& target, const Solution& solution,
                                                           const Rigid3d& camera_from_target);

// Assesses a calibration whose refinement succeeded, including cross-validation. The verdict is left to the caller
// (heba/evaluation/verdict.h). `options` are those of the calibration, `detections` those that it used.
RunResult Assess(const RunConfig& config, const std::vector<CaptureDetection>& detections,
                 const Calibration& calibration, CalibrationOptions options, const std::optional<Truth>& truth,
                 int num_threads, Console* console);

}  // namespace heba
