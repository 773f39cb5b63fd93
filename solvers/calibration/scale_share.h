// Computes what wrong lengths do to an estimate: a target is printed larger than it was designed, or the translations
// of a robot are longer than it reports.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/data/problem.h"
#include "heba/data/scale_sigmas.h"
#include "heba/data/solution.h"
#include "heba/evaluation/finding.h"
#include "heba/pair_calibration.h"

namespace heba {

struct ScaleShare {
  // The changes are those that the scales make and that the covariance of the estimate does not hold yet, in its layout
  // (WithChanges).
  std::vector<Eigen::VectorXd> changes;
  // The covariance of the solution without what the scales of targets contribute to it: all sessions of a cell have the
  // same scales.
  Covariance repeatable;
  // `scale_source`: where the scale of the result comes from and how much of the camera's position it leaves open,
  // unless all lengths are exact; and `target_scale` for each target of which an estimated scale differs from its
  // design by more than is known about it, or by as much as prints seldom do.
  std::vector<Finding> findings;
};

// Returns the share of the scales. With the unknowns x of the solution, the scales h that it held (those of targets
// that it took as designed, and those of the robots' translations) and the information H of all data and of `sigmas`,
// the scales have the covariance S = (H_hh - H_hx H_xx^-1 H_xh)^-1 and the estimate errs by -H_xx^-1 H_xh h. The
// changes are the columns of H_xx^-1 H_xh S^(1/2), and that by the mean of h, because the estimate is that without
// them. A scale that the solution estimated without prior knowledge is in its covariance already. `problem` holds the
// points that the solution used. The share is empty if a point cannot be projected. If the
// problem has a prior of an earlier session, the changes are those of its means by what all sessions have in common.
ScaleShare ShareOfScales(const Problem& problem, const Solution& solution, const ScaleSigmas& sigmas);

// Returns a solution (PairSolution, Solution) with the total covariance and the repeatable one. Other causes (Advice)
// make `changes`, which are part of both. The causes that all sessions of a cell have in common besides its scales make
// `of_cell`, which is part of the total one alone.
template <class AnySolution>
AnySolution WithShare(AnySolution solution, const ScaleShare& share, const std::vector<Eigen::VectorXd>& changes,
                      const std::vector<Eigen::VectorXd>& of_cell) {
  solution.covariance_repeatable = WithChanges(share.repeatable, changes);
  for (const std::vector<Eigen::VectorXd>* part : {&changes, &of_cell, &share.changes}) {
    solution.covariance = WithChanges(std::move(solution.covariance), *part);
  }
  return solution;
}

}  // namespace heba
