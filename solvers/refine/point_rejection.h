// Rejection of points that contradict the estimate (the loss `truncated`).
#pragma once

#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "solvers/refine/fit.h"

namespace heba {

// Flags of the points in use: for each capture, for each image, one per point.
using PointFlags = std::vector<std::vector<std::vector<bool>>>;

// Returns one flag of this value for each point.
PointFlags AllFlags(const Problem& problem, bool value);

// Sets the problem of a fit to the flagged points of `problem`, and the groups to those of the captures that have any.
// Captures and images keep their indices. `problem` must outlive the fit.
void UsePoints(const Problem& problem, const PointFlags& keep, Fit* fit);

// Returns a Failure if the flagged points are too few for the unknowns of the problem.
std::optional<Failure> CheckNumPoints(const Problem& problem, const PointFlags& keep);

// Fits robustly, and then to the points that pass their test (FindInliers), until the same points pass. `keep` becomes
// their flags.
Outcome<Fit> RefineWithRejection(const Problem& problem, Fit fit, const AdjustmentOptions& options, PointFlags* keep);

}  // namespace heba
