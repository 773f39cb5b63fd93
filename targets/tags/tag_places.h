// The parts of a picture in which libapriltag can see a tag at all. Its search takes far longer where a picture is full
// of edges than where it is smooth, whether or not these edges belong to quadrilaterals.
#pragma once

#include <vector>

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

namespace heba {

struct TagPlaceOptions {
  int decimate = 1;               // libapriltag's quad_decimate; a whole number.
  double min_side_px = 0;         // The least side of a tag that can be decoded, in pixels of the picture.
  bool is_light_in_dark = false;  // The family's quad is the inner side of a black ring, not the outer one.
};

// Returns boxes in pixels of `grey` (CV_8UC1) that together hold, with room around it, each region whose outline is
// about a quadrilateral and that stands out from the noise: dark regions, or light ones. The regions are those of
// libapriltag's adaptive threshold (Wang and Olson, "AprilTag 2", IROS 2016, section III.A), and the boxes keep to its
// tiles, so that it sees in a box what it sees in the whole picture. Boxes may overlap a little. A picture of less than
// two tiles is one box.
//
// `searched` lists regions, as boxes in pixels, that were large in coarser pictures of the same scene, so that nothing
// new is to be seen in a finer one: these are left out, and the large regions of this picture are added. It may be
// null.
std::vector<cv::Rect> FindTagPlaces(const cv::Mat& grey, const TagPlaceOptions& options,
                                    std::vector<cv::Rect>* searched);

}  // namespace heba
