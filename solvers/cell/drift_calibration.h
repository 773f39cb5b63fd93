// Calibrates cameras, targets and arms some of which creep during the captures.
#pragma once

#include <optional>
#include <vector>

#include "heba/calibration_types.h"
#include "heba/data/drift.h"
#include "heba/data/problem.h"

namespace heba {

// A calibration of images that were corrected for drifts: its poses are those at the last capture.
struct DriftCalibration {
  Problem seen;  // The points of all images, corrected.
  Calibration calibration;
  std::vector<Drift> drifts;  // The images were corrected for these; at least one.
};

// Calibrates again with creeps of DriftOptions::wanted or, if drifts are tested, of the cameras of which the first
// calibration has found that they were moved; of none of these, with that of FindCreepOfCamera. Such a creep is
// taken if it uses at least as many images as the first calibration, with residuals and errors of images that are at
// most 5 % larger; one that takes the place of no motion must explain much of the errors of the camera's images, which
// may hide it. Those that are wanted are taken without a test. `seen` is the problem that was calibrated, in the order
// of time, `first` its calibration, whose adjustment succeeded.
//
// The drifts are estimated beside all unknowns (EstimateDrifts), the images are corrected for them, and both are
// repeated until little is left. An image is corrected by its points in the target, which are moved to where they would
// have been seen alike if all bodies had stood where they stand at the end; the poses of the last calibration say how.
//
// Returns nothing if there are none to estimate, if the captures do not determine them, or if they explain no more.
std::optional<DriftCalibration> CalibrateWithDrifts(const Problem& seen, const Calibration& first,
                                                    const CalibrationOptions& options, const DriftOptions& drift);

}  // namespace heba
