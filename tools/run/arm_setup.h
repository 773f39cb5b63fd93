// Prepares the estimation of an arm's kinematics: the joints of each capture, recorded or recovered from the poses, and
// the effects of the arm's errors on the poses (heba/robot/arm_errors.h).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "heba/run_types.h"

namespace heba {

// The tool that recorded joints imply may scatter by this much. A larger scatter is no error of an arm.
inline constexpr double kMostToolScatterM = 0.05;
inline constexpr double kMostToolScatterDeg = 10;

// The positions of the joints in all captures, in one configuration of the arm.
struct ArmBranch {
  std::string name;  // "recorded", or the configuration; empty for arms without names for them.
  // One entry per capture. It is empty for a singular capture whose joints could not be recovered.
  std::vector<Eigen::VectorXd> joints;
};

// A capture at or close to a singularity of the arm, where a small change of the pose is a large one of the joints.
struct SingularCapture {
  size_t capture = 0;       // Index into Dataset::captures.
  std::string singularity;  // SingularityAt; "its joints could not be recovered" if they are missing.
};

struct ArmSetup {
  bool is_recorded = false;
  Rigid3d tip_from_gripper;
  std::vector<ArmBranch> branches;  // The candidates, of which the captures determine the right one.
  Failure reason;                   // The reason why the kinematics cannot be estimated; empty if they can.
};

// `dataset.robot` must be set. The compliance of joints (kGravity) needs the masses of the arm's links.
ArmSetup SetUpArm(const Dataset& dataset, Kinematics kinematics);

// Returns, for each configuration that has names, the joints of all captures in it. `base_from_tip`: the pose in each
// capture; `postures`: those that reach it (PosturesOf). The configuration of a singular posture is uncertain: a
// singular capture has the posture that is nearest to that of the capture next to it, whatever its configuration. A
// configuration that any other capture lacks is left out. Returns nothing for arms whose configurations have no names.
std::vector<ArmBranch> BranchesOf(const Arm& arm, const std::vector<Rigid3d>& base_from_tip,
                                  const std::vector<std::vector<Eigen::VectorXd>>& postures);

std::vector<SingularCapture> SingularCaptures(const Arm& arm, const ArmBranch& branch);

// Returns the effects of the arm's errors on the captures' poses; null for captures whose joints are missing.
std::vector<std::shared_ptr<const PoseEffect>> EffectsOf(const Arm& arm, const Rigid3d& tip_from_gripper,
                                                         const ArmBranch& branch);

// Returns the errors of an arm among which is chosen (kAuto), or those that were asked for; none for kNone. With kAuto,
// compliances are among them if the masses of the links are known and there are at least 30 captures: on recorded arms,
// they gained nothing with fewer.
std::vector<std::shared_ptr<const SharedEffects>> CandidateArmErrors(const Arm& arm, Kinematics kinematics,
                                                                     size_t num_captures);

// Returns these errors and the noise of the joints, for captures of which `num_captures` are used. Captures whose
// joints are missing have no effects.
RigArmErrors ErrorsOfArm(const Arm& arm, const ArmSetup& setup, Kinematics kinematics, size_t num_captures);

}  // namespace heba
