// How a pose lies in an optimiser's memory, and what its tangent's coordinates are called: in one place, so that a name
// cannot drift from the number that it names.
#pragma once

#include <array>
#include <string_view>

#include <ceres/manifold.h>

#include "heba/geometry/rigid3.h"

namespace heba {

// [qx, qy, qz, qw, tx, ty, tz].
using PoseBlock = std::array<double, 7>;
PoseBlock ToBlock(const Rigid3d& pose);
Rigid3d FromBlock(const double* block);

// The tangent's coordinates in order, in the child frame (Tangent6), with their units.
inline constexpr std::array<std::string_view, 6> kTangentNames = {"tx_m", "ty_m", "tz_m", "rx_rad", "ry_rad", "rz_rad"};

// Steps of a pose block are Retract(pose, tangent), with full radians (Ceres' own quaternion manifolds step by half the
// rotation vector, and on the other side).
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

// The 6 x 7 derivative of the tangent with respect to the block, at zero: a cost that knows its derivative J by the
// tangent returns J * TangentFromBlock(x), and Ceres, multiplying by PlusJacobian, has J again.
Eigen::Matrix<double, 6, 7, Eigen::RowMajor> TangentFromBlock(const double* block);

}  // namespace heba
