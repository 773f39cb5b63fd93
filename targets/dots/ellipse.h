// An ellipse in an image.
#pragma once

#include <Eigen/Core>

namespace heba {

struct Ellipse {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  // Points x with (x - centre)' shape (x - centre) < 1 are inside. Symmetric and positive definite, in 1/px^2.
  Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();

  // Returns the radius of the circle with the same area.
  double RadiusPx() const;
  // Returns the lengths of the semi-axes, the longer one first.
  Eigen::Vector2d SemiAxesPx() const;
  // Returns the half size of the bounding box, which is [centre - extent, centre + extent].
  Eigen::Vector2d ExtentPx() const;
  // Returns the ellipse whose semi-axes are longer by `step_px`.
  Ellipse Grown(double step_px) const;
  // Creates an ellipse from its semi-axes; `angle_rad` is the direction of the longer one.
  static Ellipse FromAxes(const Eigen::Vector2d& centre_px, double semi_major_px, double semi_minor_px,
                          double angle_rad);
};

}  // namespace heba
