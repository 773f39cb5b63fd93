#include "solvers/reprojection_problem.h"

#include <algorithm>

#include <ceres/manifold.h>

namespace heba {

ceres::Solver::Options ReprojectionSolverOptions(int max_iterations) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = max_iterations;
  // What is left then is far below the last step, which is itself far below the noise.
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-13;
  options.gradient_tolerance = 1e-14;
  // Steps that put a point behind the camera are refused one by one until the trust region is small enough.
  options.max_num_consecutive_invalid_steps = 50;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  return options;
}

void AddCameraBlock(const FreeParameters& free, double* params, ceres::Problem* problem) {
  const int size = static_cast<int>(free.size());
  problem->AddParameterBlock(params, size);
  std::vector<int> held;
  for (int i = 0; i < size; ++i) {
    if (!free[static_cast<size_t>(i)]) held.push_back(i);
  }
  if (static_cast<int>(held.size()) == size) {
    problem->SetParameterBlockConstant(params);
  } else if (!held.empty()) {
    problem->SetManifold(params, new ceres::SubsetManifold(size, held));
  }
}

}  // namespace heba
