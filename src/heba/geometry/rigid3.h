// Rigid transforms, named by their frames: `a_from_b` maps coordinates of frame b to frame a; it is also the pose of b
// in a. In a product the inner names are equal: a_from_c = a_from_b * b_from_c.
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace heba {

// p_in_a = rotation * p_in_b + translation, in metres. The quaternion has unit length.
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

// Returns a_from_c = a_from_b * b_from_c.
Rigid3d operator*(const Rigid3d& a_from_b, const Rigid3d& b_from_c);
// Returns point_in_a = a_from_b * point_in_b.
inline Eigen::Vector3d operator*(const Rigid3d& a_from_b, const Eigen::Vector3d& point_in_b) {
  return a_from_b.rotation * point_in_b + a_from_b.translation;
}
// Returns b_from_a.
Rigid3d Inverse(const Rigid3d& a_from_b);

// Returns the matrix of the cross product: Skew(v) * w = v x w.
Eigen::Matrix3d Skew(const Eigen::Vector3d& v);
// Returns the rotation by |rotation_vector| radians about the direction of `rotation_vector`.
Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& rotation_vector);
// Returns the rotation vector, with a length in [0, pi].
Eigen::Vector3d LogRotation(const Eigen::Quaterniond& rotation);
// Returns the angle of the rotation, in [0, pi] rad.
double RotationAngle(const Eigen::Quaterniond& rotation);
// Returns the rotation by the smallest angle that maps the direction `from` onto `to`; both have a length above zero.
Eigen::Quaterniond RotationOnto(const Eigen::Vector3d& from, const Eigen::Vector3d& to);
// Returns the rotation matrix that is nearest to `matrix` in the Frobenius norm (by SVD, with determinant +1).
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix);

// Returns the 24 rotations that map a cube to itself. Every rotation is within 63 deg of one of them.
std::vector<Eigen::Matrix3d> CubeRotations();

// A 6-vector in the tangent space at a pose: translation (m) before rotation (rad), both in the child frame. The
// retraction is a_from_b * [Exp(rotation), translation], which agrees with the exponential map of SE(3) to first order.
using Tangent6 = Eigen::Matrix<double, 6, 1>;
// Derivatives of a tangent.
using Matrix6X = Eigen::Matrix<double, 6, Eigen::Dynamic>;
Rigid3d Retract(const Rigid3d& a_from_b, const Tangent6& tangent);
// Returns the tangent for which Retract(a_from_b, tangent) == a_from_b_2.
Tangent6 LocalCoordinates(const Rigid3d& a_from_b, const Rigid3d& a_from_b_2);

// Returns the derivative of a point by a small motion (v, w) that is applied from the left: the point moves by v + w x
// point. The same matrix is the derivative in the frame of the point if T in T * point is perturbed as T * [Exp(w), v].
Eigen::Matrix<double, 3, 6> PointByMotion(const Eigen::Vector3d& point);

// Returns the adjoint matrix of T = a_from_b, which converts a perturbation on the right into one on the left: for
// small tangents, T * [Exp(w), v] = [Exp(w'), v'] * T with (v', w') = Adjoint(T) * (v, w).
Eigen::Matrix<double, 6, 6> Adjoint(const Rigid3d& a_from_b);

// Returns the mean of poses of one frame pair: the chordal mean of the rotations and the arithmetic mean of the
// translations. `poses` must not be empty.
Rigid3d MeanPose(const std::vector<Rigid3d>& poses);

// The distance and the angle between two poses of one frame pair.
double DistanceM(const Rigid3d& a, const Rigid3d& b);
double AngleRad(const Rigid3d& a, const Rigid3d& b);

}  // namespace heba
