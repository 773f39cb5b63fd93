// Rigid transforms, named by their frames: `a_from_b` maps coordinates of frame b into frame a; it is also the pose of
// b in a. In a product the inner names meet: a_from_c = a_from_b * b_from_c.
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace heba {

// p_in_a = rotation * p_in_b + translation. Metres. The quaternion has unit length.
struct Rigid3d {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3d() = default;
  Rigid3d(const Eigen::Quaterniond& rotation_in, const Eigen::Vector3d& translation_in)
      : rotation(rotation_in.normalized()), translation(translation_in) {}
  // `rotation_in` must be orthonormal with determinant 1.
  Rigid3d(const Eigen::Matrix3d& rotation_in, const Eigen::Vector3d& translation_in)
      : rotation(Eigen::Quaterniond(rotation_in).normalized()), translation(translation_in) {}

  Eigen::Matrix3d RotationMatrix() const { return rotation.toRotationMatrix(); }
  Eigen::Matrix4d Matrix() const;
};

// a_from_c = a_from_b * b_from_c.
Rigid3d operator*(const Rigid3d& a_from_b, const Rigid3d& b_from_c);
// point_in_a = a_from_b * point_in_b.
inline Eigen::Vector3d operator*(const Rigid3d& a_from_b, const Eigen::Vector3d& point_in_b) {
  return a_from_b.rotation * point_in_b + a_from_b.translation;
}
// b_from_a.
Rigid3d Inverse(const Rigid3d& a_from_b);

Eigen::Matrix3d Skew(const Eigen::Vector3d& v);
// The rotation by |rotation_vector| radians about its direction.
Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& rotation_vector);
// The rotation vector, of length in [0, pi].
Eigen::Vector3d LogRotation(const Eigen::Quaterniond& rotation);
// In [0, pi] rad.
double RotationAngle(const Eigen::Quaterniond& rotation);
// The rotation matrix nearest to `matrix` in the Frobenius norm (by SVD; determinant +1).
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix);

// The 24 rotations that map a cube to itself: no rotation is farther than 63 deg from one of them.
std::vector<Eigen::Matrix3d> CubeRotations();

// A 6-vector in the tangent space at a pose: translation (m) before rotation (rad), both in the child frame. The
// retraction is a_from_b * [Exp(rotation), translation]: it agrees with SE(3)'s exponential to first order.
using Tangent6 = Eigen::Matrix<double, 6, 1>;
Rigid3d Retract(const Rigid3d& a_from_b, const Tangent6& tangent);
// The tangent with Retract(a_from_b, tangent) == a_from_b_2.
Tangent6 LocalCoordinates(const Rigid3d& a_from_b, const Rigid3d& a_from_b_2);

// How a point moves with a small motion of the frame that it stands in (of T in T * point: T * [Exp(w), v]) or, alike,
// with one that is applied to it from the left: v + w x point.
Eigen::Matrix<double, 3, 6> PointByMotion(const Eigen::Vector3d& point);

// How left multiplication sees a right one: with T = a_from_b and small tangents,
// T * [Exp(w), v] = [Exp(w'), v'] * T where (v', w') = Adjoint(T) * (v, w).
Eigen::Matrix<double, 6, 6> Adjoint(const Rigid3d& a_from_b);

// The mean of poses of one frame pair: chordal mean of the rotations, arithmetic mean of the translations. `poses`
// must not be empty.
Rigid3d MeanPose(const std::vector<Rigid3d>& poses);

// Between two poses of one frame pair.
double DistanceM(const Rigid3d& a, const Rigid3d& b);
double AngleRad(const Rigid3d& a, const Rigid3d& b);

}  // namespace heba
