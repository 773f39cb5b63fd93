// A stand-in for an arm of which nothing is known but its poses.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/data/problem.h"
#include "heba/data/solution.h"

namespace heba {

// Returns the changes of an estimate by the errors that an arm of usual geometry has and that its captures do not show
// (solvers/calibration/unseen_errors.h), for every arm of which smooth errors are part of the solution. The stand-in is
// a UR5e, made as large as the poses need, with one sigma of .05 deg of the offsets of its joints, .3 mm of its lengths
// and .03 deg of its angles, whose ratios count and not their sizes. `problem` holds the points that the solution used.
// If it has a prior of an earlier session, which had the same arm, there are none: they are part of
// JointPrior::of_cell.
std::vector<Eigen::VectorXd> ChangesByUnknownArms(const Problem& problem, const Solution& solution);

}  // namespace heba
