// Whether the captures of a problem agree with what an earlier session told.
#pragma once

#include <string>
#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"

namespace heba {

// How the captures and the prior agree about the unknowns of one owner.
struct PriorAgreement {
  std::string block;  // The name of the owner's block.
  bool is_of_poses = false;
  // The probability by chance of so large a difference if nothing of the owner has changed, and what the others tell
  // holds; 1 if the captures tell nothing about it.
  double p_value = 1;
  // The difference as a multiple of what both leave open (RMS over the directions about which the captures tell
  // something): 1 on average by chance.
  double ratio = 0;
};

// Returns the agreement about each owner of unknowns of the problem's prior, by the score test (Rao, "Large sample
// tests of statistical hypotheses", 1948) of a change of its unknowns since the earlier session. With the difference d
// of the solution from the mean of the prior, the covariance P of the prior and C of the solution, the gradient g =
// P^-1 d has the covariance S = P^-1 - P^-1 C P^-1. Of the unknowns b of an owner, g_b^T S_bb^-1 g_b, over the
// directions about which the captures tell something, follows chi-square, or Fisher's F if the noise was estimated. A
// part that was moved contradicts in all owners, and in its own the most.
std::vector<PriorAgreement> AgreementWithPrior(const Problem& problem, const Solution& solution);

}  // namespace heba
