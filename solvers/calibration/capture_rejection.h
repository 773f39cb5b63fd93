// Rejects captures that contradict the others, unless the model rather than the captures is wrong.
#pragma once

#include <vector>

#include "heba/bundle_adjustment.h"
#include "solvers/uncertainty/capture_outliers.h"

namespace heba {

// A larger share of the captures is rejected only if no other explanation fits better.
inline constexpr double kMostWrong = 0.25;
// Captures whose errors are larger than the others' by this factor belong to another population.
inline constexpr double kDistinct = 5;

struct JudgedCaptures {
  std::vector<CaptureVerdict> verdicts;  // One per view.
  Solution solution;                     // The solution of the views that are not wrong.
  // Number of captures that failed the test, but were kept: one larger robot noise for all captures explains them
  // better than a smaller noise with this many wrong poses. 0 if there was no doubt.
  int num_kept_against_test = 0;

  int NumWrong() const;
};

// Tests the captures (FindOutlierCaptures) at `solution`, refines without those that are wrong, and tests all captures
// again, rejected ones included, until nothing changes. `options` are those of the solution (loss `truncated`, exact
// robot, free shape parameters of the target). If more than kMostWrong of the captures would be rejected, two
// explanations are compared: one robot noise for all captures, or two, with a larger one for the captures that would
// be rejected. They are rejected only if two noises are more likely by more than the cost of choosing the captures,
// and differ by a factor of kDistinct, because the tail of one population is not another population.
JudgedCaptures JudgeCaptures(const Problem& problem, const Solution& solution, const BundleOptions& options);

}  // namespace heba
