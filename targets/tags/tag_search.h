// The search for a grid of tags in an image.
#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "heba/detection.h"
#include "heba/drawing.h"
#include "targets/tags/tag_codes.h"
#include "targets/tags/tag_layout.h"

namespace heba {

// A grid of tags to search for. The referenced objects must outlive the search.
struct TagGrid {
  const TagGridGeometry& geometry;
  const TagCodes& codes;
  const TagLayout& layout;
  const Drawing& drawing;
  int max_bit_errors = 0;
};

// Detects the tags of the grid from coarse to fine, fits each to all its grey values, and returns their corners with
// the covariance of the four corners of each tag. The reason names what is missing.
//
// libapriltag detects a black region only if nothing black touches it. Kalibr's corner squares touch the tags, so
// that it misses some of them. These are searched for with the black regions separated, and then at the positions
// that the tags around them predict, where they are refined as saddles and decoded.
Detection DetectTagGrid(const cv::Mat& grey, const TagGrid& grid);

// Returns the ids of all tags of the family that are decoded without a bit error.
std::vector<int> SeenTagIds(const cv::Mat& grey, const TagGrid& grid);

}  // namespace heba
