// Refinement at pose level: hand-eye and board pose from the closed loop of every capture.
#pragma once

#include <vector>

#include "heba/base/error.h"
#include "heba/data/solution.h"
#include "heba/evaluation/metrics.h"

namespace heba {

// Minimises, with Ceres from `start`, the sum over captures of e^T S^-1 e, where e is what the loop of Mao and Zhu 2004
// (equation 1, H_gb H_tg = H_cb H_tc) fails to close by: the left perturbation (m, then rad, in the camera) between the
// target's pose that the chain predicts and the one that the picture has, and S the covariance of the latter
// (PosePair::covariance_at_1px; the mean of the others where it is unknown, 1 mm and 1 mrad if nobody knows). The
// covariance in the result is scaled by what is left of the residuals; pixel_sigma_px is that scale. The picture enters
// through six numbers only: two poses of a flat target, strong noise and a wrong camera spoil it more than the
// refinement of the reprojection error. A Failure if the motion does not determine the poses or Ceres does not
// converge.
Outcome<Solution> RefineChain(const std::vector<PosePair>& pairs, const HandEye& start);

}  // namespace heba
