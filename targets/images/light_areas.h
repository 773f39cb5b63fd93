// Connected areas of light pixels and their outlines.
#pragma once

#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

namespace heba {

// An area of pixels above a threshold, connected along sides or at corners.
struct LightArea {
  cv::Rect box;
  cv::Point first;     // Leftmost of its uppermost pixels.
  int num_pixels = 0;  // Number of its pixels, excluding holes.
};

// Finds the areas of the pixels of `grey` (CV_8UC1) above `threshold` whose bounding boxes do not touch the border of
// the image and have a longer side between `min_side_px` and `max_side_px`. They are returned in reading order of
// their first pixels.
std::vector<LightArea> FindLightAreas(const cv::Mat& grey, int threshold, int min_side_px, int max_side_px);

// Traces the outermost pixels of an area clockwise from `first` (LightArea::first), each a neighbour of the previous
// one; holes are ignored. Returns nothing if there are more than `max_points`. The area must not touch the border of
// the image.
std::optional<std::vector<cv::Point>> TraceOutline(const cv::Mat& grey, int threshold, const cv::Point& first,
                                                   size_t max_points);

}  // namespace heba
