#include "heba/geometry/rigid3.h"

#include <cmath>

#include <Eigen/SVD>

#include "heba/base/error.h"
#include "heba/base/units.h"

namespace heba {

Eigen::Matrix4d Rigid3d::Matrix() const {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = RotationMatrix();
  matrix.topRightCorner<3, 1>() = translation;
  return matrix;
}

Rigid3d operator*(const Rigid3d& a_from_b, const Rigid3d& b_from_c) {
  return {a_from_b.rotation * b_from_c.rotation, a_from_b * b_from_c.translation};
}

Rigid3d Inverse(const Rigid3d& a_from_b) {
  const Eigen::Quaterniond b_from_a_rotation = a_from_b.rotation.conjugate();
  return {b_from_a_rotation, -(b_from_a_rotation * a_from_b.translation)};
}

Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d skew;
  skew << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return skew;
}

Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  const double half = 0.5 * angle;
  // sin(half) / angle; for small angles by its series, since the quotient would lose digits.
  const double factor = angle < 1e-4 ? 0.5 - angle * angle / 48.0 : std::sin(half) / angle;
  const Eigen::Vector3d v = factor * rotation_vector;
  return Eigen::Quaterniond(std::cos(half), v.x(), v.y(), v.z()).normalized();
}

Eigen::Vector3d LogRotation(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * rotation.vec();
  const double sine = v.norm();
  if (sine < 1e-8) return 2.0 * v;
  return 2.0 * std::atan2(sine, sign * rotation.w()) / sine * v;
}

double RotationAngle(const Eigen::Quaterniond& rotation) {
  return 2.0 * std::atan2(rotation.vec().norm(), std::abs(rotation.w()));
}

Eigen::Quaterniond RotationOnto(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized();
  const Eigen::Vector3d b = to.normalized();
  // The quaternion (1 + a b, a x b) has half of the angle; it has no length left where the directions are opposite.
  constexpr double kOpposite = 1e-12;
  const double w = 1 + a.dot(b);
  if (w < kOpposite) return Eigen::Quaterniond(Eigen::AngleAxisd(kPi, a.unitOrthogonal()));
  const Eigen::Vector3d axis = a.cross(b);
  return Eigen::Quaterniond(w, axis.x(), axis.y(), axis.z()).normalized();
}

Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, 1);
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) signs.z() = -1;
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

Rigid3d Retract(const Rigid3d& a_from_b, const Tangent6& tangent) {
  return a_from_b * Rigid3d(ExpRotation(tangent.tail<3>()), tangent.head<3>());
}

Tangent6 LocalCoordinates(const Rigid3d& a_from_b, const Rigid3d& a_from_b_2) {
  const Rigid3d b_from_b_2 = Inverse(a_from_b) * a_from_b_2;
  Tangent6 tangent;
  tangent << b_from_b_2.translation, LogRotation(b_from_b_2.rotation);
  return tangent;
}

Eigen::Matrix<double, 3, 6> PointByMotion(const Eigen::Vector3d& point) {
  Eigen::Matrix<double, 3, 6> by_motion;
  by_motion << Eigen::Matrix3d::Identity(), -Skew(point);
  return by_motion;
}

Eigen::Matrix<double, 6, 6> Adjoint(const Rigid3d& a_from_b) {
  const Eigen::Matrix3d rotation = a_from_b.RotationMatrix();
  Eigen::Matrix<double, 6, 6> adjoint = Eigen::Matrix<double, 6, 6>::Zero();
  adjoint.topLeftCorner<3, 3>() = rotation;
  adjoint.topRightCorner<3, 3>() = Skew(a_from_b.translation) * rotation;
  adjoint.bottomRightCorner<3, 3>() = rotation;
  return adjoint;
}

Rigid3d MeanPose(const std::vector<Rigid3d>& poses) {
  CHECK(!poses.empty());
  Eigen::Matrix3d rotation_sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d translation_sum = Eigen::Vector3d::Zero();
  for (const Rigid3d& pose : poses) {
    rotation_sum += pose.RotationMatrix();
    translation_sum += pose.translation;
  }
  return {NearestRotation(rotation_sum), translation_sum / static_cast<double>(poses.size())};
}

double DistanceM(const Rigid3d& a, const Rigid3d& b) { return (a.translation - b.translation).norm(); }

double AngleRad(const Rigid3d& a, const Rigid3d& b) { return RotationAngle(a.rotation.conjugate() * b.rotation); }

std::vector<Eigen::Matrix3d> CubeRotations() {
  std::vector<Eigen::Matrix3d> turns;
  for (int x = 0; x < 3; ++x) {
    for (const int y : {(x + 1) % 3, (x + 2) % 3}) {
      for (const double sign_x : {1.0, -1.0}) {
        for (const double sign_y : {1.0, -1.0}) {
          Eigen::Matrix3d turn;
          turn.col(0) = sign_x * Eigen::Vector3d::Unit(x);
          turn.col(1) = sign_y * Eigen::Vector3d::Unit(y);
          turn.col(2) = turn.col(0).cross(turn.col(1));
          turns.push_back(turn);
        }
      }
    }
  }
  return turns;
}

}  // namespace heba
