// Pictures of detections that a person can check.
#pragma once

#include <optional>
#include <string>

#include <opencv2/core/mat.hpp>

#include "heba/data/problem.h"

namespace heba {

struct OverlayOptions {
  std::string caption;         // Over the picture's top-left corner.
  double magnification = 100;  // Of residual arrows.
};

// `grey` in colour with a cross at each point, its id beside it and, if given, the residual (predicted - observed, px)
// of each point as an arrow. CV_8UC3.
cv::Mat DrawOverlay(const cv::Mat& grey, const Observations& observations, const std::optional<Points2>& residuals,
                    const OverlayOptions& options = {});

}  // namespace heba
