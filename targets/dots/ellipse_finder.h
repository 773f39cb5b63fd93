// Finds the approximate positions of dots in an image.
#pragma once

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "targets/dots/ellipse.h"

namespace heba {

enum class DotPolarity { kDarkOnLight, kLightOnDark };

struct EllipseFinderOptions {
  DotPolarity polarity = DotPolarity::kDarkOnLight;
  double min_diameter_px = 4;    // Minimum length of the shorter axis.
  double max_diameter_px = 400;  // Maximum length of the longer axis.
  double max_axis_ratio = 4;
  double min_contrast_grey = 8;  // Minimum difference between inside and outside.
  // Returns the violated constraints, one per line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

struct FoundEllipse {
  Ellipse ellipse;  // Accurate to a few tenths of a pixel; RefineEllipse improves it.
  double contrast_grey = 0;
};

// Finds the elliptic areas of one polarity, each once; concentric ellipses of different sizes are distinct. Ellipses
// that touch the border of the image are omitted. `grey` is CV_8UC1; an image with a side of less than 24 px yields
// none.
std::vector<FoundEllipse> FindEllipses(const cv::Mat& grey, const EllipseFinderOptions& options);

}  // namespace heba
