// The views of a hand-eye calibration, linearised at given values.
#pragma once

#include <vector>

#include "heba/bundle_adjustment.h"
#include "solvers/refine/hand_eye_problem.h"
#include "solvers/refine/linearised_images.h"

namespace heba {

// Returns the state of a problem with this hand-eye pose, and with the camera and the shape of the problem.
inline FitState StateAt(const PairProblem& problem, const HandEye& hand_eye) {
  return {HandEyePosesOf(hand_eye), {problem.camera}, {problem.shape}, {}, {}};
}

// Returns the views, linearised there; `options` say what is free. All points must have an image.
inline std::vector<LinearisedView> LineariseViews(const PairProblem& problem, const HandEye& hand_eye,
                                                  const BundleOptions& options, double pixel_sigma_px) {
  return LineariseEachCapture(HandEyeProblem(problem, options), StateAt(problem, hand_eye), {{pixel_sigma_px}, {0}, {}},
                              LossOf(LossKind::kNone))
      .value();
}

}  // namespace heba
