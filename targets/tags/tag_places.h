// The parts of an image in which libapriltag can detect a tag at all. Its search takes far longer in an image full of
// edges than in a smooth one, whether or not these edges belong to quads.
#pragma once

#include <vector>

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

namespace heba {

struct TagPlaceOptions {
  int decimate = 1;               // libapriltag's quad_decimate; an integer.
  double min_side_px = 0;         // Minimum side of a tag that can be decoded, in pixels of the full image.
  bool is_light_in_dark = false;  // Whether the family's quad is the inner side of a black ring, not the outer one.
};

struct TagPlaces {
  std::vector<cv::Rect> boxes;
  std::vector<cv::Rect> large_px;  // Boxes of the large regions, of which a finer image shows nothing new.
};

// Returns boxes in pixels of `grey` (CV_8UC1) that together contain, with a margin, each region whose outline is
// approximately a quad and that stands out from the noise: dark regions, or light ones. The regions are those of
// libapriltag's adaptive threshold (Wang and Olson, "AprilTag 2", IROS 2016, section III.A), and the boxes are
// aligned with its tiles, so that it sees the same in a box as in the whole image. Boxes may overlap slightly. An
// image of less than two tiles is returned as one box.
//
// `searched` lists boxes, in pixels, of regions that were large in coarser images of the same scene. They are skipped.
TagPlaces FindTagPlaces(const cv::Mat& grey, const TagPlaceOptions& options,
                        const std::vector<cv::Rect>& searched = {});

}  // namespace heba
