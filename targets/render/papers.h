// Sizes of paper by name.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace heba {

struct Paper {
  std::string_view name;
  std::string_view series;  // iso or us.
  // Upright.
  double width_mm = 0;
  double height_mm = 0;

  // Returns width and height, exchanged if the paper lies on its long side.
  Eigen::Vector2d SizeMm(bool is_landscape) const {
    return is_landscape ? Eigen::Vector2d(height_mm, width_mm) : Eigen::Vector2d(width_mm, height_mm);
  }
};

// Returns papers.def: all papers, from the smallest to the largest.
const std::vector<Paper>& Papers();

}  // namespace heba
