// A problem some of whose images contradict the others.
#pragma once

#include <cstddef>
#include <functional>
#include <set>
#include <utility>

#include "heba/base/error.h"
#include "heba/refinement.h"

namespace heba {

using ImageSet = std::set<std::pair<size_t, size_t>>;  // Capture, and index in ProblemCapture::images.

// Returns the problem without the points of these images.
Problem Without(Problem problem, const ImageSet& images);

// A solution, and the images that it was found without.
struct JudgedProblem {
  Solution solution;
  ImageSet left_out;
  // Number of captures that fail their test, but are kept, because so many are not wrong by themselves.
  int num_kept_against_test = 0;
};

// Returns the problem with the points that a solution used.
Problem UsedPoints(const Problem& problem, const JudgedProblem& judged);

// Leaves out the images that contradict the others, and takes those back that do not, until nothing changes. `at` is an
// adjustment of the problem with these options. Returns the last adjustment that succeeded.
using Judge = std::function<JudgedProblem(const Problem& problem, JudgedProblem at, const AdjustmentOptions& options)>;

}  // namespace heba
