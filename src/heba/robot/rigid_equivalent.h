// An arm whose joints yield to gravity, in formats that describe a geometry alone.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/robot/arm.h"

namespace heba {

// Errors of an arm's geometry that stand for its errors with compliances.
struct RigidEquivalent {
  Eigen::VectorXd errors;  // One per parameter (ArmParamPlace); those of compliances are zero.
  // The root mean square by which the tip's poses with these errors differ from those with compliances.
  double left_m = 0;
  double left_rad = 0;
};

// Returns the errors of the geometry with which the arm's tip comes closest, by least squares, to where it is with
// `errors`, which are one per parameter and may contain compliances. `joints` are the positions of the joints (rad or
// m) where it does so; there must be one at least. What those positions do not show stays as it is in `errors`.
RigidEquivalent FitRigidEquivalent(const Arm& nominal, const Eigen::VectorXd& errors,
                                   const std::vector<Eigen::VectorXd>& joints);

}  // namespace heba
