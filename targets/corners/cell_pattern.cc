#include "targets/corners/cell_pattern.h"

#include <algorithm>
#include <utility>

#include "heba/base/error.h"

namespace heba {
namespace {

// Lines closer together than this ratio of the extent result from round-off in the drawing and are merged.
constexpr double kSameLineRatio = 1e-6;

std::vector<double> Lines(std::vector<double> at, double min, double max) {
  std::sort(at.begin(), at.end());
  const double tolerance = kSameLineRatio * (max - min);
  std::vector<double> lines;
  for (const double line : at) {
    if (line <= min + tolerance || line >= max - tolerance) continue;
    if (lines.empty() || line > lines.back() + tolerance) lines.push_back(line);
  }
  return lines;
}

double CellMiddle(const std::vector<double>& lines, size_t cell, double min, double max) {
  const double low = cell == 0 ? min : lines[cell - 1];
  const double high = cell == lines.size() ? max : lines[cell];
  return 0.5 * (low + high);
}

struct Bounds {
  Eigen::Vector2d low;
  Eigen::Vector2d high;
};
Bounds BoundsOf(const Shape& shape) {
  Bounds bounds{shape.points_m.front(), shape.points_m.front()};
  for (const Eigen::Vector2d& corner : shape.points_m) {
    bounds.low = bounds.low.cwiseMin(corner);
    bounds.high = bounds.high.cwiseMax(corner);
  }
  return bounds;
}

}  // namespace

CellPattern CellsOf(const Drawing& drawing, const Eigen::Vector2d& min_m, const Eigen::Vector2d& max_m) {
  struct Rectangle {
    Bounds bounds;
    double albedo;
  };
  std::vector<Rectangle> near;
  std::vector<double> x_m;
  std::vector<double> y_m;
  for (const Shape& shape : drawing.shapes) {
    CHECK_EQ(shape.points_m.size(), 4U) << "a cell pattern must consist of rectangles";
    const Bounds bounds = BoundsOf(shape);
    if ((bounds.high.array() <= min_m.array()).any() || (bounds.low.array() >= max_m.array()).any()) continue;
    near.push_back({bounds, shape.albedo});
    x_m.insert(x_m.end(), {bounds.low.x(), bounds.high.x()});
    y_m.insert(y_m.end(), {bounds.low.y(), bounds.high.y()});
  }
  CellPattern pattern;
  pattern.x_m = Lines(std::move(x_m), min_m.x(), max_m.x());
  pattern.y_m = Lines(std::move(y_m), min_m.y(), max_m.y());
  CHECK(std::max(pattern.x_m.size(), pattern.y_m.size()) <= CellPattern::kMaxLines) << "the pattern has too many cells";
  pattern.albedo.setConstant(static_cast<Eigen::Index>(pattern.y_m.size()) + 1,
                             static_cast<Eigen::Index>(pattern.x_m.size()) + 1, drawing.ground);
  for (Eigen::Index j = 0; j < pattern.albedo.rows(); ++j) {
    for (Eigen::Index i = 0; i < pattern.albedo.cols(); ++i) {
      const Eigen::Vector2d middle_m(CellMiddle(pattern.x_m, static_cast<size_t>(i), min_m.x(), max_m.x()),
                                     CellMiddle(pattern.y_m, static_cast<size_t>(j), min_m.y(), max_m.y()));
      for (const Rectangle& rectangle : near) {
        if ((middle_m.array() > rectangle.bounds.low.array()).all() &&
            (middle_m.array() < rectangle.bounds.high.array()).all()) {
          pattern.albedo(j, i) = rectangle.albedo;
        }
      }
    }
  }
  return pattern;
}

}  // namespace heba
