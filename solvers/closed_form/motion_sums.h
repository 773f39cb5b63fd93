// Sums of products over all motions for the AX = XB methods, computed in one pass over the pairs of captures that
// serves every method. Motions are not stored, so memory does not grow with the square of the number of captures.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/evaluation/metrics.h"

namespace heba {

// Sums over the motions A = M_j M_i^-1 and B = C_j C_i^-1 (solvers/closed_form/hand_eye_method.h) whose rotation is
// large enough to carry information (at least 5 deg, or a quarter of the largest rotation if that is less) and at
// most 170 deg, because the axis of a rotation by 180 deg is ambiguous in sign. If there are more than about two
// million pairs of captures, an evenly distributed subset is used.
struct MotionSums {
  // Sums of the products of all pairs of the 25 numbers that describe one motion, in this order.
  enum : int { kOne = 0, kRotationA = 1, kRotationB = 10, kTranslationA = 19, kTranslationB = 22, kNumLinear = 25 };
  Eigen::MatrixXd linear;  // Rotation matrices are stored column by column.
  // Likewise for the screws: the vector parts of the quaternion q of the rotation, with q_0 >= 0, and of the dual part
  // q' of the dual quaternion.
  enum : int { kRealA = 0, kDualA = 3, kRealB = 6, kDualB = 9, kNumScrew = 12 };
  Eigen::MatrixXd screws;
  // Likewise for the rotation vectors and the rotation axes.
  enum : int { kVectorA = 0, kVectorB = 3, kAxisA = 6, kAxisB = 9, kNumAxes = 12 };
  Eigen::MatrixXd axes;

  double Count() const { return linear(kOne, kOne); }
};

MotionSums SumMotions(const std::vector<PosePair>& pairs);

// Returns the sum of x cross y, given the sum of x y^T.
inline Eigen::Vector3d SumOfCross(const Eigen::Matrix3d& sum) {
  return {sum(1, 2) - sum(2, 1), sum(2, 0) - sum(0, 2), sum(0, 1) - sum(1, 0)};
}

}  // namespace heba
