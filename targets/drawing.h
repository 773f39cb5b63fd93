// What a target looks like, as flat shapes in its own plane: one description for the sheet to print and for the
// renderer.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace heba {

// A disc or, with `points`, a filled polygon (simple, either sense). Painted in order over a ground of
// `Drawing::ground`.
struct Shape {
  double albedo = 0;  // 0 is black ink, 1 is white paper.
  // Disc:
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
  double radius_m = 0;
  // Polygon, if not empty:
  std::vector<Eigen::Vector2d> points_m;
};

struct Label {
  std::string text;
  Eigen::Vector2d at_m = Eigen::Vector2d::Zero();  // Where its first letter's base line starts.
  double height_m = 0.002;
};

// In the target's plane z = 0, metres.
struct Drawing {
  // The sheet that belongs to the target: its quiet zone included.
  Eigen::Vector2d min_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d max_m = Eigen::Vector2d::Zero();
  double ground = 1;          // Albedo of the sheet.
  bool y_up = false;          // Whether the target's y points up on the sheet as it is read (else down).
  std::vector<Shape> shapes;  // Later ones cover earlier ones.
  std::vector<Label> labels;  // Printed on sheets; not rendered.

  void AddRectangle(double x0_m, double y0_m, double x1_m, double y1_m, double albedo);
  void AddDisc(const Eigen::Vector2d& centre_m, double radius_m, double albedo);
};

}  // namespace heba
