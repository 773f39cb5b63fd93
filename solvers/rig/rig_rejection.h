// The adjustment of a rig without the images that contradict the others.
#pragma once

#include <cstddef>
#include <vector>

#include "heba/rig_adjustment.h"
#include "solvers/refine/judged_problem.h"

namespace heba {

// Returns the number of images with points for which `is_counted`, a predicate of a RigImage, holds.
template <typename Predicate>
int CountImages(const RigProblem& problem, const Predicate& is_counted) {
  int num_images = 0;
  for (const RigCapture& capture : problem.captures) {
    for (const RigImage& image : capture.images) {
      if (image.observations.size() > 0 && is_counted(image)) ++num_images;
    }
  }
  return num_images;
}

// Returns the images of a capture in which an arm moves the target against the camera.
std::vector<size_t> ImagesMovedBy(const RigProblem& problem, size_t capture, size_t robot);

// Returns those of the images that are not of this camera.
ImageSet ImagesOfOthers(const RigProblem& problem, const ImageSet& images, size_t camera);

// Tests all images (Judge), those that were left out included. With the loss `none`, no image is tested.
JudgedRig LeaveOutOutliers(const RigProblem& problem, JudgedRig at, const RigOptions& options);

// Adjusts without the images that contradict the others. `left_out` are the images to begin without.
Outcome<JudgedRig> RefineWithoutOutliers(const RigProblem& problem, const RigPoses& start, ImageSet left_out,
                                         const RigOptions& options);

}  // namespace heba
