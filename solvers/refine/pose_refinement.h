// Refinement at pose level: estimates hand-eye and board pose from the closed loop of every capture.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/pair_solution.h"
#include "heba/evaluation/metrics.h"
#include "solvers/uncertainty/linearisation.h"

namespace heba {

// Minimises with Ceres, from `start`, the sum over all captures of e^T S^-1 e, where e is the misclosure of the loop
// of Mao and Zhu 2004 (equation 1, H_gb H_tg = H_cb H_tc): the left perturbation (m, then rad, in the camera frame)
// between the predicted target pose and the one estimated from the image. S is the covariance of the latter
// (PosePair::covariance_at_1px; the mean of the others if it is unknown, 1 mm and 1 mrad if all are unknown).
//
// The covariance of the result is scaled by the variance of the residuals; pixel_sigma_px is the square root of that
// scale. An image enters through six numbers only, so the two-fold ambiguity of a planar target, strong noise and a
// wrong camera do more harm than in the refinement of the reprojection error. Returns a Failure if the motion does
// not determine the poses or Ceres does not converge.
Outcome<PairSolution> RefineChain(const std::vector<PosePair>& pairs, const HandEye& start);

// Likewise, with the noise of the robot's poses and, unless `effects` is null, its systematic errors
// (PosePair::effect). The scale of S, the noise and the standard deviations of the effects are estimated by restricted
// maximum likelihood; Gauss-Newton steps alternate with that estimation until neither changes.
Outcome<PairSolution> RefineChainWithNoise(Setup setup, const std::vector<PosePair>& pairs, const HandEye& start,
                                           const std::shared_ptr<const SharedEffects>& effects);

// Returns the misclosures of all pairs at a solution of RefineChainWithNoise without effects, in units of their noise,
// one view per pair: the columns of `by_effects` are the six of the correction of the robot's pose.
std::vector<LinearisedView> LinearisePairs(Setup setup, const std::vector<PosePair>& pairs, const PairSolution& at);

// Returns the restricted log-likelihood (solvers/uncertainty/variance_components.h) of the pairs at a solution of
// RefineChainWithNoise, up to a constant that all such solutions of these pairs share.
double ChainLogLikelihoodOf(Setup setup, const std::vector<PosePair>& pairs, const PairSolution& solution);
// Likewise, as LogLikelihoodAtLeast (heba/refinement.h).
std::optional<double> ChainLogLikelihoodAtLeast(Setup setup, const std::vector<PosePair>& pairs,
                                                const PairSolution& solution, const SharedEffects& smaller);

}  // namespace heba
