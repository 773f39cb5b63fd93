// Images and captures of a rig that contradict the others.
#pragma once

#include <optional>
#include <vector>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "solvers/residuals/capture_loops.h"

namespace heba {

// The probability of a discrepancy at least this large, by chance.
struct ImageVerdict {
  ImageIndex image;             // For an arm's pose, the first image of its captures.
  std::optional<size_t> robot;  // Set if the pose of this arm contradicts the images of the capture.
  double p_value = 1;
};

// Tests the images in use, given the estimate from all others: the pose in which the camera sees the target is compared
// with the one that the other images and the arms' poses predict (the mean shift model of Baarda, "A testing procedure
// for use in geodetic networks", 1968, with six parameters). With noisy arms, tests the correction of each arm's pose
// as well. `problem` holds the points that the solution used; the solution must have been found with noisy arms or with
// exact ones.
std::vector<ImageVerdict> TestUsedImages(const Problem& problem, const Solution& solution);

// Tests images that were not used. `problem` holds their points too; `used` tells which images were.
std::vector<ImageVerdict> TestLeftOutImages(const Problem& problem, const Problem& used, const Solution& solution);

}  // namespace heba
