// Detection of a chessboard's inner corners from the grey values alone: saddle points, linked along the edges between
// them. The run time depends on the number of pixels and hardly on what they show.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace heba {

// A point around which dark and light alternate, as where four squares meet.
struct Saddle {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // Accurate to some tenths of a pixel.
  // Unit vectors along the two edges. The sector from edges[0] to edges[1], clockwise in the image, and the opposite
  // one are dark.
  std::array<Eigen::Vector2d, 2> edges;
  double contrast_grey = 0;  // Difference between light and dark sectors.
};

// Returns the saddles of an image by decreasing contrast, at most `max_saddles`. `grey` is CV_8UC1.
std::vector<Saddle> FindSaddles(const cv::Mat& grey, size_t max_saddles);

struct SaddleGrid {
  // All inner corners, row by row in some order, to about a pixel; empty if they were not found.
  std::vector<cv::Point2f> corners;
  // Region that may contain the chessboard although it was not found: a large part of a chessboard of about its size
  // is seen, its squares continue, and nothing indicates that the rest lies outside the image. Empty if there is
  // none.
  cv::Rect may_be_in;
};

// Looks for a chessboard of `size` inner corners that is not a part of a larger one. `grey` is CV_8UC1.
SaddleGrid FindSaddleGrid(const cv::Mat& grey, cv::Size size);

// A grid of inner corners of any size.
struct AnySaddleGrid {
  size_t num_seen = 0;  // The number of saddles that are linked to a grid.
  cv::Size size;
  // All corners, row by row, to about a pixel; the list is empty if saddles are missing in more than a few places.
  std::vector<cv::Point2f> corners;
};

// Returns the largest grid of saddles that are linked along edges. `grey` is CV_8UC1.
AnySaddleGrid FindLargestSaddleGrid(const cv::Mat& grey);

}  // namespace heba
