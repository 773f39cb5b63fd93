// Whether the captures of a problem agree with what an earlier session told.
#pragma once

#include "heba/data/problem.h"
#include "heba/data/solution.h"

namespace heba {

// Returns the probability by chance of so large a difference between the solution and the mean of the problem's prior.
// The difference d has the covariance P - C, where P is that of the prior and C that of the solution, which is the
// estimate from both: d^T (P - C)^-1 d, over the directions about which the captures tell something, follows chi-square,
// or Fisher's F if the noise was estimated. It is 1 if they tell nothing.
double PriorPValue(const Problem& problem, const Solution& solution);

}  // namespace heba
