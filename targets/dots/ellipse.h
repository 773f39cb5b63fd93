// An ellipse in a picture.
#pragma once

#include <Eigen/Core>

namespace heba {

struct Ellipse {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  // Inside are the x with (x - centre)' shape (x - centre) < 1. Symmetric, positive definite, 1/px^2.
  Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();

  // Of the circle with the same area.
  double RadiusPx() const;
  // The longer one first.
  Eigen::Vector2d SemiAxesPx() const;
  // The ellipse's bounding box is [centre - extent, centre + extent].
  Eigen::Vector2d ExtentPx() const;
  // Its semi-axes longer by `step_px`.
  Ellipse Grown(double step_px) const;
  // Of the longer axis.
  static Ellipse FromAxes(const Eigen::Vector2d& centre_px, double semi_major_px, double semi_minor_px,
                          double angle_rad);
};

}  // namespace heba
