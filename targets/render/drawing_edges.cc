#include "targets/render/drawing_edges.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "heba/base/error.h"
#include "heba/base/units.h"

namespace heba {
namespace {

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

bool Contains(const Shape& shape, const Eigen::Vector2d& point_m) {
  if (shape.points_m.empty()) return (point_m - shape.centre_m).squaredNorm() < shape.radius_m * shape.radius_m;
  bool inside = false;
  const size_t n = shape.points_m.size();
  for (size_t i = 0, j = n - 1; i < n; j = i++) {
    const Eigen::Vector2d& a = shape.points_m[i];
    const Eigen::Vector2d& b = shape.points_m[j];
    if ((a.y() > point_m.y()) != (b.y() > point_m.y()) &&
        point_m.x() < (b.x() - a.x()) * (point_m.y() - a.y()) / (b.y() - a.y()) + a.x()) {
      inside = !inside;
    }
  }
  return inside;
}

Eigen::AlignedBox2d BoundsOf(const Shape& shape) {
  const Eigen::Vector2d radius = Eigen::Vector2d::Constant(shape.radius_m);
  if (shape.points_m.empty()) return {shape.centre_m - radius, shape.centre_m + radius};
  Eigen::AlignedBox2d bounds_m;
  for (const Eigen::Vector2d& point : shape.points_m) bounds_m.extend(point);
  return bounds_m;
}

Eigen::AlignedBox2d BoundsOf(const AlbedoEdge& edge) {
  // Circles are split into quarters at their extremes, so that the end points bound an arc as well.
  return Eigen::AlignedBox2d(edge.At(0)).extend(edge.At(1));
}

double Length(const AlbedoEdge& edge) {
  return edge.radius_m > 0 ? edge.radius_m * std::abs(edge.end_rad - edge.start_rad)
                           : (edge.end_m - edge.start_m).norm();
}

// Returns the unit vector along the edge at `t`.
Eigen::Vector2d Direction(const AlbedoEdge& edge, double t) {
  if (edge.radius_m == 0) return (edge.end_m - edge.start_m).normalized();
  const double angle = edge.start_rad + t * (edge.end_rad - edge.start_rad);
  return {-std::sin(angle), std::cos(angle)};
}

// Returns the parameter of `point_m` along the edge's line or circle (0 to 1 within the edge).
double ParameterOf(const AlbedoEdge& edge, const Eigen::Vector2d& point_m) {
  if (edge.radius_m == 0) {
    const Eigen::Vector2d along = edge.end_m - edge.start_m;
    return (point_m - edge.start_m).dot(along) / along.squaredNorm();
  }
  const Eigen::Vector2d from_centre = point_m - edge.centre_m;
  const double middle_rad = 0.5 * (edge.start_rad + edge.end_rad);
  const double angle = std::atan2(from_centre.y(), from_centre.x());
  const double turned = middle_rad + std::remainder(angle - middle_rad, 2 * kPi);
  return (turned - edge.start_rad) / (edge.end_rad - edge.start_rad);
}

double Distance(const AlbedoEdge& edge, const Eigen::Vector2d& point_m) {
  const double t = std::clamp(ParameterOf(edge, point_m), 0.0, 1.0);
  return (edge.At(t) - point_m).norm();
}

// Returns the intersections of the lines or circles of `a` and `b`, which may lie outside the edges. If both are
// parallel lines, which may coincide, returns the end points of `b`.
std::vector<Eigen::Vector2d> Meetings(const AlbedoEdge& a, const AlbedoEdge& b, double nearness_m) {
  if (a.radius_m == 0 && b.radius_m == 0) {
    const Eigen::Vector2d along_a = a.end_m - a.start_m;
    const Eigen::Vector2d along_b = b.end_m - b.start_m;
    const double cross = Cross(along_a, along_b);
    constexpr double kParallelRad = 1e-8;
    if (std::abs(cross) < kParallelRad * along_a.norm() * along_b.norm()) return {b.start_m, b.end_m};
    return {a.start_m + along_a * (Cross(b.start_m - a.start_m, along_b) / cross)};
  }
  if (b.radius_m == 0) return Meetings(b, a, nearness_m);
  Eigen::Vector2d foot;   // Point of the chord nearest to the centre of `b`.
  Eigen::Vector2d chord;  // Direction of the chord.
  if (a.radius_m == 0) {
    chord = (a.end_m - a.start_m).normalized();
    foot = a.start_m + chord * (b.centre_m - a.start_m).dot(chord);
  } else {
    const Eigen::Vector2d between = a.centre_m - b.centre_m;
    const double distance = between.norm();
    if (distance < nearness_m) return {};
    const double along = (distance * distance + b.radius_m * b.radius_m - a.radius_m * a.radius_m) / (2 * distance);
    foot = b.centre_m + between * (along / distance);
    chord = Eigen::Vector2d(-between.y(), between.x()) / distance;
  }
  const double height = (foot - b.centre_m).norm();
  if (height > b.radius_m + nearness_m) return {};
  const double half = std::sqrt(std::max(0.0, b.radius_m * b.radius_m - height * height));
  return {foot - chord * half, foot + chord * half};
}

}  // namespace

Eigen::Vector2d AlbedoEdge::At(double t) const {
  if (radius_m == 0) return start_m + t * (end_m - start_m);
  const double angle = start_rad + t * (end_rad - start_rad);
  return centre_m + radius_m * Eigen::Vector2d(std::cos(angle), std::sin(angle));
}

DrawingEdges::DrawingEdges(const Drawing& drawing) : drawing_(drawing) {
  const Eigen::Vector2d& low = drawing_.min_m;
  const Eigen::Vector2d& high = drawing_.max_m;
  CHECK((high - low).minCoeff() > 0) << "the drawing has no sheet";
  nearness_m_ = 1e-9 * (high - low).maxCoeff();

  const auto add_polygon = [this](const std::vector<Eigen::Vector2d>& points_m) {
    for (size_t i = 0; i < points_m.size(); ++i) {
      AlbedoEdge outline;
      outline.start_m = points_m[i];
      outline.end_m = points_m[(i + 1) % points_m.size()];
      AddOutline(outline);
    }
  };
  add_polygon({low, {high.x(), low.y()}, high, {low.x(), high.y()}});
  for (const Shape& shape : drawing_.shapes) {
    add_polygon(shape.points_m);
    for (int quarter = 0; shape.points_m.empty() && shape.radius_m > 0 && quarter < 4; ++quarter) {
      AlbedoEdge outline;
      outline.centre_m = shape.centre_m;
      outline.radius_m = shape.radius_m;
      outline.start_rad = 0.5 * kPi * quarter;
      outline.end_rad = 0.5 * kPi * (quarter + 1);
      AddOutline(outline);
    }
  }

  constexpr int kMaxGridSize = 200;
  grid_size_ = std::clamp(static_cast<int>(std::sqrt(outlines_.size())), 1, kMaxGridSize);
  cells_.resize(static_cast<size_t>(grid_size_) * grid_size_);
  const double reach_m = 10 * nearness_m_;
  for (size_t i = 0; i < drawing_.shapes.size(); ++i) {
    for (const size_t cell : CellsOf(BoundsOf(drawing_.shapes[i]), reach_m)) {
      cells_[cell].shapes.push_back(static_cast<int>(i));
    }
  }
  for (size_t i = 0; i < outlines_.size(); ++i) {
    for (const size_t cell : CellsOf(BoundsOf(outlines_[i]), reach_m)) {
      cells_[cell].outlines.push_back(static_cast<int>(i));
    }
  }
  for (size_t i = 0; i < outlines_.size(); ++i) AddSeenPieces(static_cast<int>(i));
}

void DrawingEdges::AddOutline(const AlbedoEdge& outline) {
  if (Length(outline) > nearness_m_) outlines_.push_back(outline);
}

std::vector<size_t> DrawingEdges::CellsOf(const Eigen::AlignedBox2d& box_m, double reach_m) const {
  const Eigen::Array2d cell_m = (drawing_.max_m - drawing_.min_m).array() / grid_size_;
  const Eigen::Array2d first = ((box_m.min() - drawing_.min_m).array() - reach_m) / cell_m;
  const Eigen::Array2d last = ((box_m.max() - drawing_.min_m).array() + reach_m) / cell_m;
  if ((last < 0).any() || (first > grid_size_).any()) return {};
  const Eigen::Array2i begin = first.floor().max(0).min(grid_size_ - 1).cast<int>();
  const Eigen::Array2i end = last.floor().max(0).min(grid_size_ - 1).cast<int>();
  std::vector<size_t> cells;
  for (int y = begin.y(); y <= end.y(); ++y) {
    for (int x = begin.x(); x <= end.x(); ++x) cells.push_back(static_cast<size_t>(y) * grid_size_ + x);
  }
  return cells;
}

const DrawingEdges::Cell& DrawingEdges::CellAt(const Eigen::Vector2d& point_m) const {
  const Eigen::Array2d place = (point_m - drawing_.min_m).array() / (drawing_.max_m - drawing_.min_m).array();
  const Eigen::Array2i cell = (place * grid_size_).floor().max(0).min(grid_size_ - 1).cast<int>();
  return cells_[static_cast<size_t>(cell.y()) * grid_size_ + cell.x()];
}

SheetValue DrawingEdges::ValueAt(const Eigen::Vector2d& point_m) const {
  if ((point_m.array() < drawing_.min_m.array()).any() || (point_m.array() > drawing_.max_m.array()).any()) return {};
  const std::vector<int>& shapes = CellAt(point_m).shapes;
  for (auto shape = shapes.rbegin(); shape != shapes.rend(); ++shape) {
    if (Contains(drawing_.shapes[*shape], point_m)) return {drawing_.shapes[*shape].albedo, 1};
  }
  return {drawing_.ground, 1};
}

std::vector<double> DrawingEdges::Cuts(int index) const {
  const AlbedoEdge& outline = outlines_[index];
  const double tolerance = nearness_m_ / Length(outline);
  std::vector<int> others;
  // A small reach is needed because rounding may put the sheet's own border outside the sheet.
  for (const size_t cell : CellsOf(BoundsOf(outline), nearness_m_)) {
    others.insert(others.end(), cells_[cell].outlines.begin(), cells_[cell].outlines.end());
  }
  std::sort(others.begin(), others.end());
  others.erase(std::unique(others.begin(), others.end()), others.end());

  std::vector<double> cuts = {0, 1};
  for (const int other : others) {
    if (other == index) continue;
    for (const Eigen::Vector2d& point : Meetings(outline, outlines_[other], nearness_m_)) {
      const double t = ParameterOf(outline, point);
      if (t <= tolerance || t >= 1 - tolerance) continue;
      if (Distance(outline, point) > 2 * nearness_m_ || Distance(outlines_[other], point) > 2 * nearness_m_) continue;
      cuts.push_back(t);
    }
  }
  std::sort(cuts.begin(), cuts.end());
  return cuts;
}

void DrawingEdges::AddSeenPieces(int index) {
  const AlbedoEdge& outline = outlines_[index];
  const std::vector<double> cuts = Cuts(index);
  const double min_step = nearness_m_ / Length(outline);
  for (size_t i = 0, next = 1; next < cuts.size(); ++next) {
    if (cuts[next] - cuts[i] < min_step) continue;
    const double start = cuts[i];
    const double end = cuts[next];
    i = next;
    const double middle = 0.5 * (start + end);
    const Eigen::Vector2d point = outline.At(middle);
    // If outlines coincide, the first one represents all; the values are taken far enough aside to lie beyond them
    // all.
    const std::vector<int>& near = CellAt(point).outlines;
    const bool stands_for_all = std::none_of(near.begin(), near.end(), [&](int other) {
      return other < index && Distance(outlines_[other], point) < 2 * nearness_m_;
    });
    if (!stands_for_all) continue;
    const Eigen::Vector2d direction = Direction(outline, middle);
    const Eigen::Vector2d aside = 3 * nearness_m_ * Eigen::Vector2d(-direction.y(), direction.x());
    AlbedoEdge piece = outline;
    piece.positive = ValueAt(point + aside);
    piece.negative = ValueAt(point - aside);
    if (piece.positive == piece.negative) continue;
    piece.start_m = outline.At(start);
    piece.end_m = outline.At(end);
    piece.start_rad = outline.start_rad + start * (outline.end_rad - outline.start_rad);
    piece.end_rad = outline.start_rad + end * (outline.end_rad - outline.start_rad);
    edges_.push_back(piece);
  }
}

}  // namespace heba
