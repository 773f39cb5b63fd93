// Random postures of arms.
#pragma once

#include "heba/base/rng.h"
#include "heba/base/units.h"
#include "heba/robot/arm.h"

namespace heba {

inline Eigen::VectorXd RandomJoints(const Arm& arm, Rng& rng) {
  Eigen::VectorXd joints(arm.num_joints());
  for (double& joint : joints) joint = rng.Uniform(-kPi, kPi);
  return joints;
}

}  // namespace heba
