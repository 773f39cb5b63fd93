// Clutter around a target in a rendered image.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>

#include "heba/base/rng.h"
#include "heba/drawing.h"

namespace heba {

// Draws albedos (CV_32FC1): a gradient under random polygons, discs, rings, lines and marks that resemble print, all
// anti-aliased. Half of the marks are placed near the points of `outline_px`, if there are any.
cv::Mat DrawClutter(int width_px, int height_px, const std::vector<Eigen::Vector2d>& outline_px, Rng rng);

struct RoundMarksOptions {
  int count = 60;
  double min_radius_m = 0.002;  // Radius of the dots; the rings around them are up to four times as large.
  double max_radius_m = 0.01;
  // Number of sectors of the rings that resemble coded ones, and the codes (ring_code.h) that they must not have.
  int bits = 12;
  std::vector<uint32_t> avoided_codes;
};

// Returns the sheet with dots, rings, coded rings of correct and of wrong proportions, and mirrored or broken ones, at
// random positions outside `kept`.
Drawing WithRoundMarks(Drawing drawing, const RoundMarksOptions& options, const Eigen::AlignedBox2d& kept, Rng& rng);

}  // namespace heba
