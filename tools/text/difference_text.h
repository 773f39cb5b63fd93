// Words the differences between poses that several runs measured.
#pragma once

#include <string>
#include <vector>

#include "heba/evaluation/pose_difference.h"

namespace heba {

// A difference with a probability (PoseDifference::p_value) below this is significant.
inline constexpr double kSignificantChance = 0.01;

// Returns "differ" if the difference is significant, otherwise "agree".
std::string Agreement(const PoseDifference& difference);

struct NamedDifference {
  std::string names;  // The two that differ: "first and second".
  PoseDifference difference;
};
// Returns a sentence on the agreement of `what`, a plural, with the figures of the least likely difference; empty if
// there are no differences.
std::string AgreementFinding(const std::string& what, const std::vector<NamedDifference>& differences);

}  // namespace heba
