// A problem some of whose images contradict the others.
#pragma once

#include <cstddef>
#include <functional>
#include <set>
#include <utility>

#include "heba/base/error.h"
#include "heba/rig_adjustment.h"

namespace heba {

using ImageSet = std::set<std::pair<size_t, size_t>>;  // Capture, and index in RigCapture::images.

// Returns the problem without the points of these images.
RigProblem Without(RigProblem problem, const ImageSet& images);

// A solution, and the images that it was found without.
struct JudgedRig {
  RigSolution solution;
  ImageSet left_out;
  // Number of captures that fail their test, but are kept, because so many are not wrong by themselves.
  int num_kept_against_test = 0;
};

// Returns the problem with the points that a solution used.
RigProblem UsedPoints(const RigProblem& problem, const JudgedRig& judged);

// Adjusts without the images that contradict the others. `left_out` are the images to begin without; they are tested
// again, too.
using Judge = std::function<Outcome<JudgedRig>(const RigProblem& problem, const RigPoses& start, ImageSet left_out,
                                               const RigOptions& options)>;

}  // namespace heba
