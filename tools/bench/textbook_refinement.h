// The refinement as a textbook writes it for Ceres: one residual block for each point of each image, with automatic
// differentiation. The library's own refinement is measured against it.
#pragma once

#include "heba/data/pair_problem.h"

namespace heba {

struct TextbookResult {
  HandEye hand_eye;
  Camera camera;
  int iterations = 0;
  double seconds = 0;  // Duration of ceres::Solve.
  bool converged = false;
};

// Refines hand-eye pose, board pose and all nine intrinsics of a brown5 camera. Like the library, it uses dense
// normal equations and one thread.
TextbookResult RefineAsInTextbooks(const PairProblem& problem, const HandEye& start);

}  // namespace heba
