// The adjustment of a rig without the images that contradict the others.
#pragma once

#include <cstddef>
#include <set>
#include <utility>
#include <vector>

#include "heba/rig_adjustment.h"

namespace heba {

using ImageSet = std::set<std::pair<size_t, size_t>>;  // Capture, and index in RigCapture::images.

// Returns the problem without the points of these images.
RigProblem Without(RigProblem problem, const ImageSet& images);

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

// A solution, and the images that it was found without.
struct JudgedRig {
  RigSolution solution;
  ImageSet left_out;
};

// Returns the problem with the points that a solution used.
RigProblem UsedPoints(const RigProblem& problem, const JudgedRig& judged);

// Adjusts without the images that contradict the others, and tests all images again, those that were left out included,
// until nothing changes. `left_out` are the images to begin without. With the loss `none`, no image is tested.
Outcome<JudgedRig> RefineWithoutOutliers(const RigProblem& problem, const RigPoses& start, ImageSet left_out,
                                         const RigOptions& options);

}  // namespace heba
