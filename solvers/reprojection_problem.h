// What every Ceres problem over views has in common.
#pragma once

#include <ceres/problem.h>
#include <ceres/solver.h>

#include "solvers/information.h"

namespace heba {

// Settings for small dense problems solved to the last digit that matters; one thread, so that the result does not
// depend on their number.
ceres::Solver::Options ReprojectionSolverOptions(int max_iterations);

// Adds the camera's parameters to `problem` and holds those that are not free.
void AddCameraBlock(const FreeParameters& free, double* params, ceres::Problem* problem);

}  // namespace heba
