// Which captures an estimate rests on: those that contradict the others are left out, unless the model is what is
// wrong.
#pragma once

#include <vector>

#include "solvers/refine/bundle_adjustment.h"
#include "solvers/uncertainty/capture_outliers.h"

namespace heba {

// More than this share of the captures is not left out without a look at what else explains them.
inline constexpr double kMostWrong = 0.25;
// Captures whose errors are larger by this factor than the others' are another population.
inline constexpr double kDistinct = 5;

struct JudgedCaptures {
  std::vector<CaptureVerdict> verdicts;        // One a view.
  Solution solution;                           // The solution of the views that are not wrong.
  std::vector<std::vector<int>> rejected_ids;  // One a view of the problem, wrong ones included.
  // So many captures failed the test, but a robot with more noise explains all of them better than one with less noise
  // and so many wrong poses: none is left out. 0 if there was no doubt.
  int num_kept_against_test = 0;

  int NumWrong() const;
};

// Tests the captures (FindOutlierCaptures) at `solution`, refines without those that are wrong, and tests all of them
// again, those left out too, until nothing changes. `options` are those of the solution (loss `truncated`, exact robot,
// what of the target's shape may be unknown). Where more than kMostWrong of the captures would go, two explanations are
// compared: one noise of the robot for all captures, and two, one for those that stay and a larger one for those that
// would go. These go only if two noises are more likely by more than the choice of the captures costs, and differ by a
// factor of kDistinct: the tail of one population is not another.
JudgedCaptures JudgeCaptures(const Problem& problem, const Solution& solution, const BundleOptions& options);

}  // namespace heba
