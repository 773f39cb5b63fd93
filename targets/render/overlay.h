// Images of detections for visual inspection.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "heba/data/pair_problem.h"

namespace heba {

// The points of one target in an image.
struct OverlayPoints {
  Observations observations;
  std::optional<Points2> residuals;  // Predicted - observed, px.
  double magnification = 100;        // Magnification of the residuals' arrows.
  std::string caption;               // A line in the top-left corner of the image.
};

// Draws `grey` in colour with a cross at each point of the targets, its id beside it and, if given, its residual as an
// arrow. Each target has a colour of its own, which its caption has too if there are several. Images narrower than
// 1200 px are enlarged by an integer factor. Returns CV_8UC3.
cv::Mat DrawOverlay(const cv::Mat& grey, const std::vector<OverlayPoints>& targets);

}  // namespace heba
