// The memory layout of a pose in an optimiser, and the names of its tangent coordinates. Both are defined here and
// nowhere else, so that names and numbers always agree.
#pragma once

#include <array>
#include <string_view>

#include <ceres/manifold.h>

#include "heba/geometry/rigid3.h"

namespace heba {

// The layout is [qx, qy, qz, qw, tx, ty, tz], the translation in metres.
using PoseBlock = std::array<double, 7>;
PoseBlock ToBlock(const Rigid3d& pose);
Rigid3d FromBlock(const double* block);

// Names of the tangent coordinates in order, with their units. The tangent is in the child frame (Tangent6).
inline constexpr std::array<std::string_view, 6> kTangentNames = {"tx_m", "ty_m", "tz_m", "rx_rad", "ry_rad", "rz_rad"};

// The Ceres manifold of a pose block. Its steps are Retract(pose, tangent) with rotation vectors in radians. The
// quaternion manifolds of Ceres step by half the rotation vector, and on the other side.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

// Returns the 6 x 7 derivative of the tangent by the block, at zero. A cost function that knows its derivative J by the
// tangent returns J * TangentFromBlock(x); Ceres multiplies it by PlusJacobian and obtains J again.
Eigen::Matrix<double, 6, 7, Eigen::RowMajor> TangentFromBlock(const double* block);

}  // namespace heba
