// A second detection pass over an image, once the approximate position of the target in it is known.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "heba/target.h"

namespace heba {

struct GuidedDetection {
  Detection detection;
  int num_added = 0;    // Number of points that only the second pass found.
  int num_dropped = 0;  // Number of points of the first pass that are not where they are expected.
};

// Repeats the detection with known approximate pixels. `expected_px[i]` is where the point with index i in points()
// is expected, to within `tolerance_px`, or nothing if the point is out of view. Points of `first` that are farther
// than `tolerance_px` from the expected pixel are dropped. If points are missing, the target is searched for in the
// part of the image that should contain it, which is smaller and less cluttered than the whole image. Points that
// were measured together are kept or dropped together. Points of the first pass that are where they are expected
// remain unchanged.
GuidedDetection DetectGuided(const Target& target, const cv::Mat& grey, const Detection& first,
                             const std::vector<std::optional<Eigen::Vector2d>>& expected_px, double tolerance_px);

}  // namespace heba
