// Where the albedo of a drawing changes: the seen pieces of its shapes' outlines, each once, with what lies on either
// side. Shapes may overlap and share outlines (to a billionth of the drawing's size); parts off the sheet are not seen.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "targets/drawing.h"

namespace heba {

// What a point of the plane shows.
struct SheetValue {
  double albedo = 0;
  double on_sheet = 0;  // 1 on the sheet; else 0, as is then the albedo.
  bool operator==(const SheetValue&) const = default;
};

// A piece of a straight line, from `start` to `end`, or of a circle.
struct AlbedoEdge {
  Eigen::Vector2d start_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d end_m = Eigen::Vector2d::Zero();
  // Circle, if radius_m is not 0:
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
  double radius_m = 0;
  double start_rad = 0;
  double end_rad = 0;
  // On the side to which x turns into y, seen along the edge, and on the other one.
  SheetValue positive;
  SheetValue negative;

  // `t` from 0 at the start to 1 at the end.
  Eigen::Vector2d At(double t) const;
};

class DrawingEdges {
 public:
  explicit DrawingEdges(const Drawing& drawing);

  const std::vector<AlbedoEdge>& edges() const { return edges_; }
  SheetValue ValueAt(const Eigen::Vector2d& point_m) const;

 private:
  // What a cell of a uniform grid over the sheet touches, by increasing index.
  struct Cell {
    std::vector<int> shapes;
    std::vector<int> outlines;
  };

  void AddOutline(const AlbedoEdge& outline);
  // The indices of the cells that [low_m, high_m], grown by `reach_m`, touches; none if it is off the sheet.
  std::vector<size_t> CellsOf(const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m, double reach_m) const;
  const Cell& CellAt(const Eigen::Vector2d& point_m) const;
  std::vector<double> Cuts(int outline) const;
  void AddSeenPieces(int outline);

  Drawing drawing_;
  double nearness_m_ = 0;             // Outlines nearer than this are one.
  std::vector<AlbedoEdge> outlines_;  // Of the sheet and of all shapes, covered or not.
  int grid_size_ = 1;
  std::vector<Cell> cells_;
  std::vector<AlbedoEdge> edges_;
};

}  // namespace heba
