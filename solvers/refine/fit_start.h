// The estimate that a refinement starts from.
#pragma once

#include "heba/base/error.h"
#include "solvers/refine/fit.h"
#include "solvers/refine/point_rejection.h"

namespace heba {

struct FitStart {
  Fit fit;
  PointFlags keep;  // The points in use: all but those of images whose target is hidden at the start.
};

// Returns the fit of a problem at its start, with the pixel noise that the median of the residuals there tells, or that
// the options state or start from, and with the noise of the arms that the options start from. `problem` must outlive
// it. Fails if points are too few, if a point is behind its camera (with the loss `truncated`: in more than half of the
// images), or if the points do not determine the unknowns.
Outcome<FitStart> StartFit(const Problem& problem, const CellPoses& start, const AdjustmentOptions& options);

}  // namespace heba
