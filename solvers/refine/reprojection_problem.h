// What every Ceres problem over views has in common.
#pragma once

#include <ceres/problem.h>
#include <ceres/solver.h>

#include "solvers/refine/captures_cost.h"
#include "solvers/uncertainty/information.h"

namespace heba {

// Settings for small dense problems solved to the last digit that matters; one thread, so that the result does not
// depend on their number.
ceres::Solver::Options ReprojectionSolverOptions(int max_iterations);

// Adds the camera's parameters to `problem` and holds those that are not free.
void AddCameraBlock(const FreeParameters& free, double* params, ceres::Problem* problem);

// ceres::Solve of a problem that has no other cost than `cost`. It converges, too, where the next step would lower the
// cost by less than options.function_tolerance of it: Ceres alone sees that only when it has taken that step.
ceres::Solver::Summary SolveCaptures(const CapturesCost& cost, ceres::Solver::Options options, ceres::Problem* problem);

}  // namespace heba
