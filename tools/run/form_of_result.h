// The part of a result that its form has by itself: that of one camera, one target and one arm, or that of any number.
#pragma once

#include <vector>

#include "heba/evaluation/finding.h"
#include "heba/run_types.h"
#include "solvers/calibration/held_out.h"
#include "tools/run/image_results.h"

namespace heba {

struct FormOfResult {
  RunResult result;                             // The poses, their errors and the arms.
  std::vector<DistancesOfCaptures> held_out_m;  // One per camera, or empty without hold-outs.
  std::vector<Finding> of_calibration;          // CalibratedImages::findings.
  std::vector<Finding> of_arms;
};

// Returns the figures of one camera, or of one of several, with the errors of the captures that were left out.
template <class ErrorFigures>
ErrorFigures WithLeftOut(ErrorFigures figures, const HeldOutErrors& left_out) {
  if (!left_out.has_hidden) figures.left_out_rms_px = left_out.pixels.RmsPx();
  if (const std::optional<double> distance_m = left_out.RmsDistanceM()) {
    figures.left_out_target_mm = 1000 * *distance_m;
  }
  return figures;
}

}  // namespace heba
