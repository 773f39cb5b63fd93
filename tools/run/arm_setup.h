// Prepares the estimation of an arm's kinematics: the joints of each capture, recorded or recovered from the poses, and
// the effects of the arm's errors on the poses (heba/robot/arm_errors.h).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "heba/run_types.h"

namespace heba {

// The tool that recorded joints imply may scatter by this much before its scatter is explained by errors of the arm.
inline constexpr double kMostToolScatterM = 0.05;
inline constexpr double kMostToolScatterDeg = 10;

// The positions of the joints in all captures, in one configuration of the arm.
struct ArmBranch {
  std::string name;  // "recorded", or the configuration; empty for arms without names for them.
  // One entry per capture. It is empty for a singular capture whose joints could not be recovered, and for one that the
  // arm cannot reach in this configuration.
  std::vector<Eigen::VectorXd> joints;
  std::vector<bool> is_out_of_reach = {};  // One entry per capture, or empty: none is.

  bool Reaches(size_t capture) const { return is_out_of_reach.empty() || !is_out_of_reach[capture]; }
  bool ReachesAll() const;
};

// A capture at or close to a singularity of the arm, where a small change of the pose is a large one of the joints.
struct SingularCapture {
  size_t capture = 0;       // Index into Dataset::captures.
  std::string singularity;  // SingularityAt; "its joints could not be recovered" if they are missing.
};

struct ArmSetup {
  bool is_recorded = false;
  Rigid3d tip_from_gripper;
  std::vector<ArmBranch> branches;  // The candidates, of which the captures determine the right ones.
  Failure reason;                   // The reason why the kinematics cannot be estimated; empty if they can.
};

// A capture whose recorded joints contradict its pose.
struct ContradictingJoints {
  size_t capture = 0;  // Index into Dataset::captures.
  // How far the joints put the tool from where those of the other captures do.
  double apart_m = 0;
  double apart_rad = 0;
};

// Returns the captures whose joints of an arm put the tool at another place than those of most others; none if joints
// are not recorded, or if so many do that it is not clear which are right.
std::vector<ContradictingJoints> FindContradictingJoints(const Dataset& dataset, size_t robot);

// Returns why such a capture is left out, as one clause. `whose`: the joints, "its joints" or "the joints of arm left".
std::string WhyLeftOut(const ContradictingJoints& joints, const std::string& whose);

// Returns whether a reason is that the arm, its tool or its joints contradict the poses.
bool IsContradiction(const Failure& reason);

// Returns the joints of an arm, whose kinematics must be known (Dataset::arms). The compliance of joints (kGravity)
// needs the masses of the arm's links.
ArmSetup SetUpArm(const Dataset& dataset, size_t robot, Kinematics kinematics);

// Returns whether the joints of an arm are recorded in all captures.
bool AreJointsRecorded(const Dataset& dataset, size_t robot);

// Returns, for each configuration that has names, the joints of all captures in it. `base_from_tip`: the pose in each
// capture; `postures`: those that reach it (PosturesOf). The configuration of a singular posture is uncertain: a
// singular capture has the posture that is nearest to that of the capture next to it, whatever its configuration.
// Returns nothing for arms whose configurations have no names.
std::vector<ArmBranch> BranchesOf(const Arm& arm, const std::vector<Rigid3d>& base_from_tip,
                                  const std::vector<std::vector<Eigen::VectorXd>>& postures);

// Returns the joints of all captures, each in its configuration: an index into `branches`. The name of the result is
// that of all configurations.
ArmBranch Combined(const std::vector<ArmBranch>& branches, const std::vector<size_t>& branch_of_captures);

std::vector<SingularCapture> SingularCaptures(const Arm& arm, const ArmBranch& branch);

// Returns the effects of the arm's errors on the captures' poses; null for captures whose joints are missing.
std::vector<std::shared_ptr<const PoseEffect>> EffectsOf(const Arm& arm, const Rigid3d& tip_from_gripper,
                                                         const ArmBranch& branch);

// Returns the errors of an arm among which is chosen (kAuto), or those that were asked for; none for kNone. Compliances
// are estimated only if they are asked for: on recorded arms they gain nothing that matters, and no controller and no
// description of an arm holds them.
std::vector<std::shared_ptr<const SharedEffects>> CandidateArmErrors(const Arm& arm, Kinematics kinematics);

// Returns these errors and the noise of the joints. Captures whose joints are missing have no effects.
ArmErrorModels ErrorsOfArm(const Arm& arm, const ArmSetup& setup, Kinematics kinematics);

}  // namespace heba
