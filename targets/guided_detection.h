// A second look at a picture once it is known where the target must be.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "targets/target.h"

namespace heba {

struct GuidedDetection {
  Detection detection;
  int num_added = 0;    // Points that the first pass missed.
  int num_dropped = 0;  // Points of the first pass that lie elsewhere.
};

// `expected_px[i]`: where the target's point i (by its index in points()) must be, give or take `tolerance_px`; nothing
// where it is out of view. Points of `first` that lie elsewhere are dropped; if some are missing, the target is
// searched for in the part of the picture where it must be, which is smaller and less cluttered than the whole. Points
// that were measured together stay or go together. What the first pass found and is where it must be stays as it is.
GuidedDetection DetectGuided(const Target& target, const cv::Mat& grey, const Detection& first,
                             const std::vector<std::optional<Eigen::Vector2d>>& expected_px, double tolerance_px);

}  // namespace heba
