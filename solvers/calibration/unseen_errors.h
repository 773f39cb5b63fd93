// An estimate that takes the errors of an arm that nobody named for smooth errors changes by them as computed here.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// The errors of a stand-in for an arm: one sigma of each, and the derivatives of the gripper's pose (Tangent6, in its
// own frame) by them, one per group of captures at one pose (GroupByRobotPoses).
struct StandInErrors {
  Eigen::VectorXd sigmas;
  std::vector<Matrix6X> gripper_by_errors;
};

// Returns the changes of the estimate by the errors of an arm of which smooth errors are part of the solution, in the
// layout of its covariance (WithChanges). Smooth errors are independent at distant poses; those of an arm are not: a
// part of them moves all captures alike, which no capture shows.
//
// With the derivatives B of the poses by the errors e, which have the variances D, and the estimate x = C sum_i J_i^T
// S_i^-1 y_i, the errors change x by H e, H = C sum_i J_i^T S_i^-1 A_i B_i. Their amplitude is the one by which the
// captures err: the squares of the residuals without smooth errors exceed those of the noise by a^2 tr(D M), M = B^T
// (S^-1 - S^-1 J (J^T S^-1 J)^-1 J^T S^-1) B; it is at most kMostAmplitude. The covariance C holds C P C for the smooth
// errors, whose prior information is P. The changes are the columns of the part of a^2 H D H^T - C P C that increases
// C. They are none if a point cannot be projected, or if the solution has no smooth errors of the arm.
std::vector<Eigen::VectorXd> ChangesByUnseenErrors(const Problem& problem, const Solution& solution, size_t robot,
                                                   const StandInErrors& errors);

inline constexpr double kMostAmplitude = 3;

}  // namespace heba
