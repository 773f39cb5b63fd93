// Whether the captures of a problem agree with what an earlier session told.
#pragma once

#include <string>
#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"

namespace heba {

// How the solution and the prior agree about the unknowns of one owner.
struct PriorAgreement {
  std::string block;  // The name of the owner's block.
  // The probability by chance of so large a difference between the solution and the mean of the prior; 1 if the
  // captures tell nothing about them.
  double p_value = 1;
  // The difference that the captures alone would make, as a multiple of what the prior and they leave open (RMS over
  // the directions about which they tell something): 1 on average by chance.
  double ratio = 0;
};

// Returns the agreement about each owner of unknowns of the problem's prior. The difference d has the covariance P - C,
// where P is that of the prior and C that of the solution, which is the estimate from both: d^T (P - C)^-1 d, over the
// directions about which the captures tell something, follows chi-square, or Fisher's F if the noise was estimated.
std::vector<PriorAgreement> AgreementWithPrior(const Problem& problem, const Solution& solution);

}  // namespace heba
