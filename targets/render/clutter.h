// What stands around a target in a rendered picture.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>

#include "heba/base/rng.h"
#include "targets/drawing.h"

namespace heba {

// CV_32FC1, albedos: a gradient under random polygons, discs, rings, lines and marks like print, anti-aliased. Some
// stand near the points of `outline_px`, which may be empty.
cv::Mat DrawClutter(int width_px, int height_px, const std::vector<Eigen::Vector2d>& outline_px, Rng rng);

struct RoundMarksOptions {
  int count = 60;
  double min_radius_m = 0.002;  // Of the dots; the rings about them are up to four times as large.
  double max_radius_m = 0.01;
  // Sectors of the rings that look like coded ones, and the codes (ring_code.h) that they do not have.
  int bits = 12;
  std::vector<uint32_t> avoided_codes;
};

// Adds dots, rings, coded rings of right and of wrong proportions, and mirrored or broken ones to the sheet, at random
// places that leave `kept` free.
void AddRoundMarks(const RoundMarksOptions& options, const Eigen::AlignedBox2d& kept, Rng& rng, Drawing* drawing);

}  // namespace heba
