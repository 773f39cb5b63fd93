// How good images are as captures of a calibration: exposure, sharpness, and how much of what a session needs they
// cover.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "heba/data/observations.h"

namespace heba {

// Returns what the exposure of an image lacks; empty if nothing. `grey` is CV_8UC1.
std::string ExposureText(const cv::Mat& grey);

// Returns one sigma of the blur of the edges near the points of a target, px: the median over the points of C / (sqrt(2
// pi) G), with the contrast C and the largest gradient G around a point, along the image axis in which that is smaller.
// A step that falls on pixels without any other blur has 0.4 to 0.8 px. Nothing if the points are too close to the
// border, or too faint.
std::optional<double> BlurPx(const cv::Mat& grey, const std::vector<Eigen::Vector2d>& pixels);

// Returns what the sharpness of an image lacks, given that of the sharpest image; empty if nothing.
std::string SharpnessText(double blur_px, double sharpest_px);

// The points of a target in an image.
struct SeenTarget {
  Observations observations;
  int width_px = 0;
  int height_px = 0;
};

// The places, the sizes and the tilts of the target in the images of one camera, each as a share of what a good session
// covers.
struct Gauges {
  double x = 0;
  double y = 0;
  double size = 0;
  double skew = 0;
};
Gauges GaugesOf(const std::vector<SeenTarget>& seen);

}  // namespace heba
