// The limits by which results are graded. They suit usual cells.
#pragma once

#include <algorithm>
#include <vector>

#include "heba/evaluation/finding.h"

namespace heba {

// A figure up to `doubtful` is graded good, up to `bad` doubtful, and above it bad.
struct Limits {
  double doubtful;
  double bad;
};

// A requirement (RunResult::requirements) replaces the first five.
inline constexpr Limits kPositionMm = {1, 5};
inline constexpr Limits kOrientationDeg = {0.1, 0.5};
inline constexpr Limits kAtWorkMm = {1, 5};
inline constexpr Limits kHeldOutMm = {1.5, 5};
inline constexpr Limits kHeldOutDeg = {0.3, 1};
inline constexpr Limits kHeldOutChi2 = {1.5, 3};  // Per degree of freedom; 1 if the model is right.
inline constexpr Limits kPixelSigmaPx = {1, 5};
inline constexpr Limits kShareLeftOut = {0.25, 0.6};  // Share of the captures that show the target.
inline constexpr int kFewCaptures = 8;

inline Grade GradeOf(double value, const Limits& limits) {
  if (!(value <= limits.bad)) return Grade::kBad;
  return value <= limits.doubtful ? Grade::kGood : Grade::kDoubtful;
}

// Sorts findings: the worst first; among equal grades, causes first.
inline void SortFindings(std::vector<Finding>* findings) {
  std::stable_sort(findings->begin(), findings->end(), [](const Finding& a, const Finding& b) {
    return a.grade != b.grade ? a.grade > b.grade : a.is_cause && !b.is_cause;
  });
}

}  // namespace heba
