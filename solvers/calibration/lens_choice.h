// The choice of a camera's lens on a whole problem.
#pragma once

#include <vector>

#include "heba/base/error.h"
#include "heba/pair_calibration_types.h"
#include "heba/refinement.h"
#include "solvers/calibration/problem_model.h"

namespace heba {

// The problem in which models are compared: its points have fixed weights.
struct ModelComparison {
  Problem problem;
  CellPoses start;
  AdjustmentOptions options;
  ModelSpace space;
};

struct LensChoice {
  Solution solution;  // That of the chosen lens.
  std::vector<CameraAlternative> alternatives;
};

// Chooses the smallest lens of a camera that no larger one rejects, under an error model; one without distortion only
// if no other one can be fitted. Returns a Failure if none can be fitted.
Outcome<LensChoice> ChooseLens(const ModelComparison& comparison, size_t camera, const ProblemModel& model);

// Returns the problems with the lenses that are tried until one can be fitted: as given, and with the other lenses of
// each camera, the largest first.
std::vector<Problem> WithLenses(const Problem& problem, const ModelSpace& space);

}  // namespace heba
