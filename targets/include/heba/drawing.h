// The appearance of a target as flat shapes in its own plane, used both for the printed sheet and by the renderer.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace heba {

// A disc or, if `points_m` is not empty, a filled simple polygon with vertices in either order. Shapes are painted in
// order on a ground of albedo `Drawing::ground`.
struct Shape {
  double albedo = 0;  // 0 is black ink, 1 is white paper.
  // Centre and radius of a disc.
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
  double radius_m = 0;
  // Vertices of a polygon; empty for a disc.
  std::vector<Eigen::Vector2d> points_m;
};

struct Label {
  std::string text;
  Eigen::Vector2d at_m = Eigen::Vector2d::Zero();  // Start of the first letter's baseline.
  double height_m = 0.002;
};

// A drawing in the target's plane z = 0, in metres.
struct Drawing {
  // The extent of the sheet that belongs to the target, including its quiet zone.
  Eigen::Vector2d min_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d max_m = Eigen::Vector2d::Zero();
  double ground = 1;          // Albedo of the sheet.
  bool y_up = false;          // Whether the target's y axis points up on the printed sheet (else down).
  std::vector<Shape> shapes;  // Later shapes cover earlier ones.
  std::vector<Label> labels;  // Printed on sheets but not rendered.

  void AddRectangle(double x0_m, double y0_m, double x1_m, double y1_m, double albedo);
  void AddDisc(const Eigen::Vector2d& centre_m, double radius_m, double albedo);
};

}  // namespace heba
