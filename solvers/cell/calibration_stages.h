// The two stages of Calibrate (heba/calibration.h), for a caller that has other images, or more points, after the
// first.
#pragma once

#include "heba/base/error.h"
#include "heba/calibration_types.h"
#include "heba/data/problem.h"
#include "solvers/refine/judged_problem.h"

namespace heba {

// A calibration before the search for its model.
struct StartedCalibration {
  // It has no refined solution yet. The problem has all images but those that a motion of a camera leaves out, and the
  // shapes of targets that are to be chosen are free as far as the images determine them.
  Calibration calibration;
  Outcome<JudgedProblem> judged;  // The first adjustment; arms have no errors but noise.
};

// Estimates the cameras, calibrates the pairs, joins them, and adjusts without the images that contradict the others.
// Unless errors of arms are known, which look like motions, cameras that were moved are found. Returns the Failures of
// Calibrate, but for that of the adjustment.
Outcome<StartedCalibration> StartCalibration(const Problem& problem, const CalibrationOptions& options);

// Returns the first adjustment, which succeeded, as a calibration: it predicts where images show points.
Calibration FirstAdjustment(const StartedCalibration& started);

// Searches for the model: errors of arms, shapes of targets, and with known arms the cameras that were moved.
Calibration FinishCalibration(StartedCalibration started, const CalibrationOptions& options);

}  // namespace heba
