#include "heba/geometry/pose_block.h"

namespace heba {
namespace {

// Returns d(q * [v, 1]) / dv for a unit quaternion in x, y, z, w order: twice the derivative of q * Exp(v) at v = 0.
Eigen::Matrix<double, 4, 3> RightStep(const double* q) {
  Eigen::Matrix<double, 4, 3> step;
  step << q[3], -q[2], q[1],  //
      q[2], q[3], -q[0],      //
      -q[1], q[0], q[3],      //
      -q[0], -q[1], -q[2];
  return step;
}

}  // namespace

PoseBlock ToBlock(const Rigid3d& pose) {
  return {pose.rotation.x(),    pose.rotation.y(),    pose.rotation.z(),   pose.rotation.w(),
          pose.translation.x(), pose.translation.y(), pose.translation.z()};
}

Rigid3d FromBlock(const double* block) {
  return {Eigen::Quaterniond(block[3], block[0], block[1], block[2]), Eigen::Vector3d(block[4], block[5], block[6])};
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const PoseBlock moved = ToBlock(Retract(FromBlock(x), Eigen::Map<const Tangent6>(delta)));
  std::copy(moved.begin(), moved.end(), x_plus_delta);
  return true;
}

bool PoseManifold::PlusJacobian(const double* x, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> plus(jacobian);
  plus.setZero();
  plus.block<4, 3>(0, 3) = 0.5 * RightStep(x);
  plus.block<3, 3>(4, 0) = FromBlock(x).RotationMatrix();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  Eigen::Map<Tangent6> tangent(y_minus_x);
  tangent = LocalCoordinates(FromBlock(x), FromBlock(y));
  return true;
}

bool PoseManifold::MinusJacobian(const double* x, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> minus(jacobian);
  minus = TangentFromBlock(x);
  return true;
}

Eigen::Matrix<double, 6, 7, Eigen::RowMajor> TangentFromBlock(const double* block) {
  Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus = Eigen::Matrix<double, 6, 7, Eigen::RowMajor>::Zero();
  minus.block<3, 3>(0, 4) = FromBlock(block).RotationMatrix().transpose();
  minus.block<3, 4>(3, 0) = 2.0 * RightStep(block).transpose();
  return minus;
}

}  // namespace heba
