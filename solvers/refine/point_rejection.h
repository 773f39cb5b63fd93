// Least squares over the points that pass a test at the estimate that they give (the loss `truncated`).
#pragma once

#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "solvers/refine/fit.h"

namespace heba {

using PointFlags = std::vector<std::vector<bool>>;  // Indexed by view and point.

// Returns the problem with the flagged points only, without a copy if these are all.
SharedProblem KeepFlaggedPoints(const Problem& problem, const PointFlags& keep);
// Returns the number of flags that are set.
int CountFlags(const PointFlags& flags);

// Returns a Failure unless there are more measured coordinates than unknowns.
std::optional<Failure> CheckNumPoints(int num_points, const UnknownLayout& unknowns);

// Least squares over the points that pass their test at the resulting estimate. The initial estimate uses the Cauchy
// loss, whose scale shrinks with the residuals, so outliers have little influence on it.
Outcome<Fit> RefineWithRejection(const Problem& problem, Fit fit, const FreeUnknowns& free,
                                 const BundleOptions& options, PointFlags* keep);

}  // namespace heba
