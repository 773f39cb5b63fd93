// A flat pattern of upright rectangular cells (a tag, the squares around a chessboard corner): what a drawing shows
// there.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "targets/drawing.h"

namespace heba {

// Cells between lines; the outermost ones go on for ever.
struct CellPattern {
  static constexpr size_t kMaxLines = 64;  // Along either axis.
  std::vector<double> x_m;                 // Increasing, as y_m.
  std::vector<double> y_m;
  // albedo(j, i) lies between x_m[i - 1] and x_m[i], y_m[j - 1] and y_m[j].
  Eigen::MatrixXd albedo;
};

// What a drawing shows between two corners. Its shapes there must be upright rectangles.
CellPattern CellsOf(const Drawing& drawing, const Eigen::Vector2d& min_m, const Eigen::Vector2d& max_m);

}  // namespace heba
