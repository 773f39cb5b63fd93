// What the errors of arms that are estimated leave: errors of the arms' poses that vary smoothly with the pose.
#pragma once

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/pair_calibration_types.h"

namespace heba {

// Returns, for each arm whose own errors are part of the solution, the finding `smooth_errors` if the captures show
// that its poses have smooth errors besides (kRandomErrorsRejected), and what these do to the estimate: the solution
// takes them for noise of single captures, which averages out, while errors of neighbouring captures do not. With the
// estimate x = C sum_i J_i^T S_i^-1 y_i of captures whose poses (derivative A_i) err by B_i s, where the s have the
// variances D, the covariance of x grows by H D H^T, H = C sum_i J_i^T S_i^-1 A_i B_i. Each change is one column of H
// D^(1/2), in the layout of the solution's covariance (WithChanges). `problem` holds the points that the solution used.
// The advice is empty if a point cannot be projected.
Advice DiagnoseSmoothRemainder(const Problem& problem, const Solution& solution);

}  // namespace heba
