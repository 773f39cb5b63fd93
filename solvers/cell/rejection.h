// The adjustment of a rig without the images that contradict the others.
#pragma once

#include <cstddef>
#include <vector>

#include "heba/refinement.h"
#include "solvers/refine/judged_problem.h"

namespace heba {

// Returns the number of images with points for which `is_counted`, a predicate of a ProblemImage, holds.
template <typename Predicate>
int CountImages(const Problem& problem, const Predicate& is_counted) {
  int num_images = 0;
  for (const ProblemCapture& capture : problem.captures) {
    for (const ProblemImage& image : capture.images) {
      if (image.observations.size() > 0 && is_counted(image)) ++num_images;
    }
  }
  return num_images;
}

// Returns the images of a capture in which an arm moves the target against the camera.
std::vector<size_t> ImagesMovedBy(const Problem& problem, size_t capture, size_t robot);

// Returns those of the images that are not of this camera.
ImageSet ImagesOfOthers(const Problem& problem, const ImageSet& images, size_t camera);

// Tests all images (Judge), those that were left out included. With the loss `none`, no image is tested.
JudgedProblem LeaveOutOutliers(const Problem& problem, JudgedProblem at, const AdjustmentOptions& options);

// Adjusts without the images that contradict the others. `left_out` are the images to begin without.
Outcome<JudgedProblem> RefineWithoutOutliers(const Problem& problem, const CellPoses& start, ImageSet left_out,
                                             const AdjustmentOptions& options);

}  // namespace heba
