// The part of a drawing that consists of axis-aligned rectangular cells, such as a tag or the squares around a
// chessboard corner.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/drawing.h"

namespace heba {

// A grid of cells between lines. The outermost cells extend to infinity.
struct CellPattern {
  static constexpr size_t kMaxLines = 64;  // Along either axis.
  std::vector<double> x_m;                 // Positions of the lines x = const, increasing.
  std::vector<double> y_m;                 // Positions of the lines y = const, increasing.
  // albedo(j, i) is the albedo between x_m[i - 1] and x_m[i] along x, and between y_m[j - 1] and y_m[j] along y.
  Eigen::MatrixXd albedo;
};

// Returns the cells of a drawing between two corners. All shapes of the drawing must be polygons of four points, and
// those between the corners axis-aligned rectangles; there may be at most CellPattern::kMaxLines lines along an axis.
CellPattern CellsOf(const Drawing& drawing, const Eigen::Vector2d& min_m, const Eigen::Vector2d& max_m);

}  // namespace heba
