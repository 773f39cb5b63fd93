#include "targets/dots/ellipse.h"

#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "heba/base/factorisation.h"

namespace heba {

double Ellipse::RadiusPx() const { return std::pow(shape.determinant(), -0.25); }

Eigen::Vector2d Ellipse::SemiAxesPx() const { return EigenOfSymmetric(shape).values.cwiseSqrt().cwiseInverse(); }

Eigen::Vector2d Ellipse::ExtentPx() const { return shape.inverse().diagonal().cwiseSqrt(); }

Ellipse Ellipse::FromAxes(const Eigen::Vector2d& centre_px, double semi_major_px, double semi_minor_px,
                          double angle_rad) {
  const Eigen::Matrix2d rotation = Eigen::Rotation2Dd(angle_rad).toRotationMatrix();
  const Eigen::Vector2d weights(1 / (semi_major_px * semi_major_px), 1 / (semi_minor_px * semi_minor_px));
  return {centre_px, rotation * weights.asDiagonal() * rotation.transpose()};
}

Ellipse Ellipse::Grown(double step_px) const {
  const SymmetricEigen<2> eigen = EigenOfSymmetric(shape);
  const Eigen::Vector2d semi_axes_px = eigen.values.cwiseSqrt().cwiseInverse().array() + step_px;
  const Eigen::Matrix2d& axes = eigen.vectors;
  return {centre_px, axes * semi_axes_px.cwiseAbs2().cwiseInverse().asDiagonal() * axes.transpose()};
}

}  // namespace heba
