// The search for ArUco markers in an image. The method is that of S. Garrido-Jurado, R. Munoz-Salinas,
// F. J. Madrid-Cuevas and M. J. Marin-Jimenez, "Automatic generation and detection of highly reliable fiducial markers
// under occlusion", Pattern Recognition 47 (2014), section 4, with the stages and limits of cv::aruco::detectMarkers in
// OpenCV 4.6, so that the same markers are found:
// 1. Thresholds by the mean grey value of a window, for windows of several sizes.
// 2. Outlines of the dark areas that are quadrangles: convex, large enough and away from the image's border.
// 3. The largest of outlines that lie on one another.
// 4. The cells within each outline, after the perspective is taken out, by Otsu's threshold.
// 5. Identification in the dictionary.
// A marker's corners are the centres of pixels: of the outermost ones of its black border.
#pragma once

#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "targets/tags/aruco_dictionary.h"
#include "targets/tags/tag_layout.h"

namespace heba {

struct ArucoMarkers {
  // The index of each is its number in the dictionary. The corners run clockwise from the marker's top left. A marker
  // may occur twice. No bit errors are stated.
  std::vector<SeenTag> markers;
  // The corners in px, clockwise in the image, of quadrangles that are no markers of this dictionary.
  std::vector<TagCorners> rejected;
};

// Finds the markers of a dictionary in a CV_8UC1 image, which may be a part of another one. Their perimeter is at least
// 1 % of the image's longer side. An image without pixels has no markers.
ArucoMarkers FindArucoMarkers(const cv::Mat& grey, const ArucoDictionary& dictionary);

// Returns the marker of a dictionary within a convex outline whose corners are in px and run clockwise in the image, as
// in ArucoMarkers; nothing if there is none. More than 35 % as many white cells in the border as the marker has cells
// inside of it, or more than 60 % of the correctable bits wrong, are no marker.
std::optional<SeenTag> ReadArucoMarker(const cv::Mat& grey, const TagCorners& outline,
                                       const ArucoDictionary& dictionary);

}  // namespace heba
