// Which captures an estimate rests on: those that contradict the others are left out, unless the model is what is
// wrong.
#pragma once

#include <vector>

#include "solvers/bundle_adjustment.h"
#include "solvers/capture_test.h"

namespace heba {

// More than this share of the captures is not left out without a look at what else explains them.
inline constexpr double kMostWrong = 0.25;

struct JudgedCaptures {
  std::vector<CaptureVerdict> verdicts;        // One a view.
  Solution solution;                           // Of the views that are not wrong, with their rejected_ids.
  std::vector<std::vector<int>> rejected_ids;  // One a view of the problem, wrong ones included.
  // So many captures failed the test, but a robot with more noise explains all of them better than one with less noise
  // and so many wrong poses: none is left out. 0 if there was no doubt.
  int num_kept_against_test = 0;

  int NumWrong() const;
};

// Tests the captures (TestCaptures) at `solution`, refines without those that are wrong, and tests all of them again,
// those left out too, until nothing changes. `options` are those of the solution (loss `truncated`, exact robot, what
// of the target's shape may be unknown). Where more than kMostWrong of the captures would go, the restricted likelihood
// decides between the two explanations: one noise for all, or wrong poses (anywhere within kWrongPoseM, kWrongPoseRad)
// beside a better robot.
JudgedCaptures JudgeCaptures(const Problem& problem, const Solution& solution, const BundleOptions& options);

// One sigma of a wrong pose: as of another capture of the session.
inline constexpr double kWrongPoseM = 0.05;
inline constexpr double kWrongPoseRad = 0.1;

}  // namespace heba
