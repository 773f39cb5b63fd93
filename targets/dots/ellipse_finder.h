// Dots in a picture: about where they are.
#pragma once

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "targets/dots/ellipse.h"

namespace heba {

enum class DotPolarity { kDarkOnLight, kLightOnDark };

struct EllipseFinderOptions {
  DotPolarity polarity = DotPolarity::kDarkOnLight;
  double min_diameter_px = 4;    // Of the shorter axis.
  double max_diameter_px = 400;  // Of the longer axis.
  double max_axis_ratio = 4;
  double min_contrast_grey = 8;  // Between inside and outside.
  // Every violated constraint, one a line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

struct FoundEllipse {
  Ellipse ellipse;  // To a few tenths of a pixel: RefineEllipse knows better.
  double contrast_grey = 0;
};

// The elliptic areas of one polarity, each once; concentric ones of different size are different. Not those that touch
// the picture's border. `grey` is CV_8UC1.
std::vector<FoundEllipse> FindEllipses(const cv::Mat& grey, const EllipseFinderOptions& options);

}  // namespace heba
