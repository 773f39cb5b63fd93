// What the AX = XB methods need of all motions: sums of products, in one pass over the pairs of captures that serves
// every method. No list of motions is stored, so that memory does not grow with the square of the captures.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/evaluation/metrics.h"

namespace heba {

// Sums over the motions A = M_j M_i^-1 and B = C_j C_i^-1 (solvers/closed_form/hand_eye_method.h) whose rotation is
// large enough to carry information (5 deg, or a quarter of the largest one) and not so near half a turn that its axis
// could flip. Of more than some million pairs of captures an even choice is taken.
struct MotionSums {
  // Of the products of all pairs of numbers that one motion has, in this order.
  enum : int { kOne = 0, kRotationA = 1, kRotationB = 10, kTranslationA = 19, kTranslationB = 22, kNumLinear = 25 };
  Eigen::MatrixXd linear;  // Rotation matrices column by column.
  // The same of the screws: with the rotation's quaternion q, q_0 >= 0, and the dual quaternion's dual part q',
  enum : int { kRealA = 0, kDualA = 3, kRealB = 6, kDualB = 9, kNumScrew = 12 };
  Eigen::MatrixXd screws;  // the vector parts of q and q'.
  // And of the rotation vectors and the axes.
  enum : int { kVectorA = 0, kVectorB = 3, kAxisA = 6, kAxisB = 9, kNumAxes = 12 };
  Eigen::MatrixXd axes;

  double Count() const { return linear(kOne, kOne); }
};

MotionSums SumMotions(const std::vector<PosePair>& pairs);

// The sum of x cross y from that of x y^T.
inline Eigen::Vector3d SumOfCross(const Eigen::Matrix3d& sum) {
  return {sum(1, 2) - sum(2, 1), sum(2, 0) - sum(0, 2), sum(0, 1) - sum(1, 0)};
}

}  // namespace heba
