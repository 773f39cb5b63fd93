// A chessboard's inner corners by the grey values alone: saddles, linked along the edges between them. What this takes
// depends on the number of pixels, hardly on what they show.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace heba {

// A place around which dark and light alternate, as where four squares meet.
struct Saddle {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // To some tenths of a pixel.
  // Unit vectors along the two edges. The sector from edges[0] to edges[1], clockwise in the image, and the opposite
  // one are dark.
  std::array<Eigen::Vector2d, 2> edges;
  double contrast_grey = 0;  // Between light and dark sectors.
};

// The saddles of an image, those of the highest contrast first, at most `max_saddles`. `grey` is CV_8UC1.
std::vector<Saddle> FindSaddles(const cv::Mat& grey, size_t max_saddles);

struct SaddleGrid {
  // All of a board's inner corners, row by row in some order, to about a pixel; empty if they were not found.
  std::vector<cv::Point2f> corners;
  // The area in which the board may be although it was not found: a good part of a board of about its size is seen, its
  // squares go on, and nothing says that the rest is outside of the image. Empty if there is none.
  cv::Rect may_be_in;
};

// Looks for a board of `size` inner corners, and not a part of a larger one. `grey` is CV_8UC1.
SaddleGrid FindSaddleGrid(const cv::Mat& grey, cv::Size size);

}  // namespace heba
