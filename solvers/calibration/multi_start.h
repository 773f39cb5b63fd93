// Refines from several initial guesses if one is not enough.
//
// The refinement converges from an initial guess that is wrong by no more than 45 deg and 30 cm. Closed forms are
// worse than that if captures contradict one another, or if a small target is seen with much noise.
#pragma once

#include <string>
#include <vector>

#include "heba/bundle_adjustment.h"
#include "heba/evaluation/metrics.h"

namespace heba {

struct InitialGuess {
  std::string name;
  HandEye hand_eye;
};

// Returns the sigma of one pixel coordinate, px, from the median distance between predicted and observed points. It
// rates an initial guess even if half of the points are outliers. Infinite if half of the points have no image. At
// most 40 views, evenly spaced, are used.
double RobustScalePx(const Camera& camera, const std::vector<View>& views, const HandEye& hand_eye);

struct MultiStartSolution {
  Outcome<PairSolution> solution = {};
  std::string seed;  // Name of the initial guess that led to it.
};

// Refines from the first of `seeds` and returns that solution unless it is doubtful: it failed, it rejects at least a
// fifth of the points, or its residuals are more than three times those of the best captures under their own poses
// (`pairs`, for the first views) and more than 2 mm at the target, an error that no robot has.
//
// If it is doubtful, other initial guesses are tried: the remaining seeds, closed forms of random small subsets of the
// captures, some of which contain no outlier, and, if the limits above are exceeded tenfold, the 24 rotations of a
// cube. Each guess is refined roughly, on a part of the captures with fixed intrinsics. The best one is refined on all
// captures, and returned if its robust cost is lower than that of the first solution. The result is deterministic.
MultiStartSolution RefineFromMultipleStarts(const PairProblem& problem, const std::vector<PosePair>& pairs,
                                            const std::vector<InitialGuess>& seeds, const BundleOptions& options);

}  // namespace heba
