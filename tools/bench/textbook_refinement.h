// The refinement as a textbook writes it for Ceres: a residual block for every point of every picture, differentiated
// automatically. What the library's own is measured against.
#pragma once

#include "heba/data/problem.h"

namespace heba {

struct TextbookResult {
  HandEye hand_eye;
  Camera camera;
  int iterations = 0;
  double seconds = 0;  // Of ceres::Solve.
  bool converged = false;
};

// brown5 only; hand-eye, board and all nine intrinsics are free. As the library's: dense normal equations, one thread.
TextbookResult RefineAsInTextbooks(const Problem& problem, const HandEye& start);

}  // namespace heba
