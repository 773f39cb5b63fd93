// The offset between the clock of a camera and that of a robot that moves while the images are taken.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "solvers/uncertainty/linearisation.h"

namespace heba {

struct TimeOffset {
  double change_s = 0;
  double sigma_s = 0;
  // The change of the estimate by one sigma of the offset, as a column that WithChanges takes.
  Eigen::VectorXd change_of_estimate;
};

// Returns what is left of the offset at a solution, beside all its unknowns x, which have the covariance C. The views
// are its captures, linearised in units of their noise; the first six columns of `by_effects` are those of the arm's
// pose, and `variances` those of all its columns. The pose of the arm is that at the time of the capture plus the
// offset, and changes with it by `velocities` (of the gripper in its own frame, one for each view). With the column D =
// (columns of the arm's pose) v and the residuals r, all whitened,
//   S = D^T D - D^T A_x C A_x^T D,  change = D^T r / S,  sigma = S^(-1/2).
// Returns nothing if the captures do not determine the offset, as when the arm stands still in all of them.
std::optional<TimeOffset> EstimateTimeOffset(std::vector<LinearisedView> views, const Eigen::VectorXd& variances,
                                             const Eigen::MatrixXd& covariance,
                                             const std::vector<Tangent6>& velocities);

// Likewise for the captures of a problem with one arm, each of which has a velocity. Also returns nothing if a point
// cannot be projected.
std::optional<TimeOffset> EstimateTimeOffset(const Problem& problem, const Solution& solution,
                                             const std::vector<Tangent6>& velocities);

}  // namespace heba
