// Connected areas of light pixels and their outlines.
#pragma once

#include <vector>

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

namespace heba {

// Pixels above a threshold that touch each other along a side or at a corner.
struct LightArea {
  cv::Rect box;
  cv::Point first;     // Of its uppermost pixels the leftmost.
  int num_pixels = 0;  // Without holes.
};

// The areas of the pixels of `grey` (CV_8UC1) above `threshold` whose boxes do not touch the picture's border and have
// a longer side between `min_side_px` and `max_side_px`, by row of their first pixels.
std::vector<LightArea> FindLightAreas(const cv::Mat& grey, int threshold, int min_side_px, int max_side_px);

// The outermost pixels of an area in their order around it, each a neighbour of the last; holes have no part in it.
// False if there are more than `max_points`. The area must not touch the picture's border.
bool TraceOutline(const cv::Mat& grey, int threshold, const cv::Point& first, size_t max_points,
                  std::vector<cv::Point>* outline);

}  // namespace heba
