// The detectors of OpenCV and AprilTag, called as their users call them.
#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "heba/detection.h"

namespace heba {

// All corners of a board row by row, in any of the board's orders, or none.
using Corners = std::vector<cv::Point2f>;

struct BoardSize {
  int rows = 0;
  int columns = 0;
  size_t NumCorners() const { return static_cast<size_t>(rows) * static_cast<size_t>(columns); }
};

// cv::findChessboardCornersSB.
Corners BySectors(const cv::Mat& grey, const BoardSize& size, int flags);
// cv::findChessboardCorners, refined by cv::cornerSubPix in windows of 2 half_px + 1 px.
Corners BySubPix(const cv::Mat& grey, const BoardSize& size, int half_px);

// The corners of tags 36h11, with heba's ids (four times that of the tag, and the corner): by libapriltag with this
// decimation, and by OpenCV's aruco with corners refined by cv::cornerSubPix.
Detection FindWithAprilTag(const cv::Mat& grey, double decimate);
Detection FindWithAruco(const cv::Mat& grey);

}  // namespace heba
