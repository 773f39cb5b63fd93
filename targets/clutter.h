// What stands around a target in a rendered picture.
#pragma once

#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "heba/base/rng.h"

namespace heba {

// CV_32FC1, albedos: a gradient under random polygons, discs, rings, lines and marks like print, anti-aliased. Some
// stand near the points of `outline_px`, which may be empty.
cv::Mat DrawClutter(int width_px, int height_px, const std::vector<Eigen::Vector2d>& outline_px, Rng rng);

}  // namespace heba
