// Refinement from more than one start, where one is not enough.
//
// The refinement finds its way from a start that is wrong by no more than 45 deg and 30 cm;
// closed forms are worse than that where captures contradict one another or a small board is seen with much noise.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/metrics.h"
#include "solvers/refine/bundle_adjustment.h"

namespace heba {

struct InitialGuess {
  std::string name;
  HandEye hand_eye;
};

// The median distance between predicted and observed points as one coordinate's sigma, px: what a start is worth though
// half of the points be anything. Infinite if half of them have no image. Of many views a part is looked at.
double RobustScalePx(const Camera& camera, const std::vector<View>& views, const HandEye& hand_eye);

struct MultiStartSolution {
  Outcome<Solution> solution = Failure{"not run"};
  std::string seed;  // The name of the start that led to it.
};

// Refines from the first of `seeds`. If that fails, leaves out a fifth of the points or more, or explains the points
// three times worse than their own poses explain the best captures (`pairs`, of the first views) and by more than 2 mm
// at the target, which no robot is off by, it tries others: the
// other seeds, the closed form of random handfuls of captures, of which some have no wrong one among them, and, if
// nothing came near, the 24 turns of a cube. Each is refined on a part of the captures with the intrinsics held; the
// best of them is refined on all, and taken if it explains the points better, robustly measured. Deterministic.
MultiStartSolution RefineFromMultipleStarts(const Problem& problem, const std::vector<PosePair>& pairs,
                                            const std::vector<InitialGuess>& seeds, const BundleOptions& options);

}  // namespace heba
