#include "heba/drawing.h"

namespace heba {

void Drawing::AddRectangle(double x0_m, double y0_m, double x1_m, double y1_m, double albedo) {
  Shape shape;
  shape.albedo = albedo;
  shape.points_m = {{x0_m, y0_m}, {x1_m, y0_m}, {x1_m, y1_m}, {x0_m, y1_m}};
  shapes.push_back(std::move(shape));
}

void Drawing::AddDisc(const Eigen::Vector2d& centre_m, double radius_m, double albedo) {
  Shape shape;
  shape.albedo = albedo;
  shape.centre_m = centre_m;
  shape.radius_m = radius_m;
  shapes.push_back(std::move(shape));
}

}  // namespace heba
