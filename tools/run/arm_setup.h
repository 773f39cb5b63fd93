// Prepares the estimation of an arm's kinematics: the joints of each capture, recorded or recovered from the poses, and
// the effects of the arm's errors on the poses (heba/robot/arm_errors.h).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "heba/run.h"

namespace heba {

// The positions of the joints in all captures, in one configuration of the arm.
struct ArmBranch {
  std::string name;                     // "recorded", or the configuration; empty for arms without names for them.
  std::vector<Eigen::VectorXd> joints;  // One entry per capture.
};

struct ArmSetup {
  bool is_recorded = false;
  Rigid3d tip_from_gripper;
  std::vector<ArmBranch> branches;  // The candidates, of which the captures determine the right one.
  // Reason why the kinematics cannot be estimated, in one clause; empty if they can.
  std::string reason;
};

// `dataset.robot` must be set.
ArmSetup SetUpArm(const Dataset& dataset);

// Returns the effects of the arm's errors on the captures' poses.
std::vector<std::shared_ptr<const PoseEffect>> EffectsOf(const Dataset& dataset, const ArmSetup& setup,
                                                         const ArmBranch& branch);

}  // namespace heba
