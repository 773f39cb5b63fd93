// Common parts of all Ceres problems over views.
#pragma once

#include <ceres/problem.h>
#include <ceres/solver.h>

#include "solvers/refine/captures_cost.h"
#include "solvers/uncertainty/information.h"

namespace heba {

// Returns settings for small dense problems that are solved to full precision. One thread is used, so that the result
// does not depend on the number of threads.
ceres::Solver::Options ReprojectionSolverOptions(int max_iterations);

// Adds the camera parameters to `problem` and holds those that are not free constant.
void AddCameraBlock(const FreeParameters& free, double* params, ceres::Problem* problem);

// Calls ceres::Solve for a problem whose only cost is `cost`. Convergence is also reached if the predicted relative
// decrease of the cost in the next step is below options.function_tolerance; Ceres alone detects that only after the
// step.
ceres::Solver::Summary SolveCaptures(const CapturesCost& cost, ceres::Solver::Options options, ceres::Problem* problem);

}  // namespace heba
