// The adjustment of a rig as a textbook writes it for Ceres: one residual block for each point of each image, with
// automatic differentiation, and one for the prior of each correction. The library's own adjustment is measured against
// it.
#pragma once

#include <vector>

#include "heba/data/pair_solution.h"
#include "heba/data/problem.h"

namespace heba {

// The values of the unknowns.
struct TextbookCellState {
  CellPoses poses;
  std::vector<Camera> cameras;
  // gripper_from_corrected_gripper: for each capture, one for each arm.
  std::vector<std::vector<Rigid3d>> corrections;
};

struct TextbookCellResult {
  TextbookCellState state;
  double initial_cost = 0;  // Half the sum of the squared whitened residuals, those of the priors included.
  double final_cost = 0;
  int iterations = 0;
  bool converged = false;
};

struct TextbookCellOptions {
  double pixel_noise_px = 0;         // One sigma of each pixel coordinate.
  RobotNoise robot_noise;            // The prior of the corrections.
  int max_iterations = 200;          // With zero, only the cost of the start is computed.
  double function_tolerance = 1e-6;  // The default of Ceres.
};

// Refines the poses of all cameras, targets and bases but the first, all nine intrinsics of the cameras, which must be
// brown5, and a correction of each pose of each arm. The cameras must stand in the world, the targets on grippers. The
// corrections are eliminated with the dense Schur complement of Ceres, on one thread.
TextbookCellResult RefineCellAsInTextbooks(const Problem& problem, const TextbookCellState& start,
                                           const TextbookCellOptions& options);

}  // namespace heba
