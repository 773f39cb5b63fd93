// Images of detections for visual inspection.
#pragma once

#include <optional>
#include <string>

#include <opencv2/core/mat.hpp>

#include "heba/data/problem.h"

namespace heba {

struct OverlayOptions {
  std::string caption;         // Text in the top-left corner of the image.
  double magnification = 100;  // Magnification of the residual arrows.
};

// Draws `grey` in colour with a cross at each point, its id beside it and, if given, its residual (predicted -
// observed, px) as an arrow. Images narrower than 1200 px are enlarged by an integer factor. Returns CV_8UC3.
cv::Mat DrawOverlay(const cv::Mat& grey, const Observations& observations, const std::optional<Points2>& residuals,
                    const OverlayOptions& options = {});

}  // namespace heba
