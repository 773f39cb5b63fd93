// Errors of a robot's poses that vary smoothly with the pose, for a robot whose arm is not known: a Gaussian process
// over the pose of the gripper (Rasmussen and Williams, "Gaussian processes for machine learning", 2006, chapter 2).
//
// Each coordinate of the error, translation (m) and rotation vector (rad) along the axes of the base, is a function of
// the pose with mean zero and the covariance
//   sigma^2 exp(-|p - p'|^2 / (2 l_t^2) - |R - R'|_F^2 / (4 l_r^2)),
// where |R - R'|_F^2 / 2 is the square of the angle between the poses while it is small. The two standard deviations
// sigma, of the translation and of the rotation, are those of the groups of effects().
//
// The process is represented by its values at some of the poses: by the columns of the pivoted Cholesky factor of the
// covariance (Harbrecht, Peters and Schneider, "On the low-rank approximation by the pivoted Cholesky decomposition",
// 2012), so that an error is linear in effects that all captures share.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "heba/data/shared_effects.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// The distances over which the error changes.
struct SmoothLengths {
  double translation_m = 0.4;
  double rotation_rad = 0.8;
};

class SmoothErrors {
 public:
  // `base_from_gripper` are the poses that the robot reports. There are at most kMostColumns basis functions; what they
  // lack is left to the noise of each capture.
  SmoothErrors(const std::vector<Rigid3d>& base_from_gripper, const SmoothLengths& lengths);

  const SmoothLengths& lengths() const { return lengths_; }
  // The effects, with the groups "smooth translations" (m) and "smooth rotations" (rad).
  const SharedEffects& effects() const { return effects_; }
  // Sets the standard deviations of the groups.
  void SetSigmas(const std::vector<double>& sigmas);
  // Returns the derivative of the tangent of the gripper's pose (m, rad, in its own frame) by the effects.
  Matrix6X GripperByEffects(const Rigid3d& base_from_gripper) const;
  // Returns the error at a pose: MakeLinearEffect of that derivative.
  std::shared_ptr<const PoseEffect> EffectAt(const Rigid3d& base_from_gripper) const;

 private:
  // Returns the basis functions at a pose.
  Eigen::VectorXd BasisAt(const Rigid3d& base_from_gripper) const;

  SmoothLengths lengths_;
  std::vector<Rigid3d> pivots_;
  Eigen::MatrixXd root_;  // Lower triangular: root_ * root_^T is the covariance of the pivots at sigma = 1.
  SharedEffects effects_;
};

}  // namespace heba
