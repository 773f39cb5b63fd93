// The edges at which the albedo of a drawing changes: the visible pieces of its shapes' outlines, each once, with the
// values on either side. Shapes may overlap and share outlines (to a billionth of the drawing's size); parts outside
// the sheet are not visible.
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "heba/drawing.h"

namespace heba {

// The appearance of a point in the plane.
struct SheetValue {
  double albedo = 0;
  double on_sheet = 0;  // 1 on the sheet, else 0; the albedo off the sheet is 0.
  bool operator==(const SheetValue&) const = default;
};

// A piece of a straight line from `start_m` to `end_m`, or of a circle.
struct AlbedoEdge {
  Eigen::Vector2d start_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d end_m = Eigen::Vector2d::Zero();
  // Centre, radius and angles of a circular piece; the radius of a straight piece is 0.
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
  double radius_m = 0;
  double start_rad = 0;
  double end_rad = 0;
  // Values on either side: `positive` is the side in the edge's direction rotated by 90 degrees from x towards y.
  SheetValue positive;
  SheetValue negative;

  // Returns the point at `t`, which runs from 0 at the start to 1 at the end.
  Eigen::Vector2d At(double t) const;
};

class DrawingEdges {
 public:
  explicit DrawingEdges(const Drawing& drawing);

  const std::vector<AlbedoEdge>& edges() const { return edges_; }
  SheetValue ValueAt(const Eigen::Vector2d& point_m) const;

 private:
  // Indices of the shapes and outlines that touch a cell of a uniform grid over the sheet, in increasing order.
  struct Cell {
    std::vector<int> shapes;
    std::vector<int> outlines;
  };

  void AddOutline(const AlbedoEdge& outline);
  // Returns the indices of the cells that touch a box, grown by `reach_m`; none if it lies off the sheet.
  std::vector<size_t> CellsOf(const Eigen::AlignedBox2d& box_m, double reach_m) const;
  const Cell& CellAt(const Eigen::Vector2d& point_m) const;
  std::vector<double> Cuts(int outline) const;
  void AddSeenPieces(int outline);

  Drawing drawing_;
  double nearness_m_ = 0;             // Outlines nearer than this coincide.
  std::vector<AlbedoEdge> outlines_;  // Outlines of the sheet and of all shapes, covered or not.
  int grid_size_ = 1;
  std::vector<Cell> cells_;
  std::vector<AlbedoEdge> edges_;
};

}  // namespace heba
