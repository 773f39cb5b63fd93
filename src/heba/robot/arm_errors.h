// The errors of an arm's kinematics as effects that captures share (heba/data/shared_effects.h): one for each parameter
// of the arm (heba/robot/arm.h), the amount by which the true value exceeds the nominal one.
//
// The error of a pose multiplies the pose that the controller reports,
//   base_from_gripper = base_from_gripper_reported * gripper_from_tip * FK(q)^-1 FK(q; errors) * tip_from_gripper,
// so that a controller that computes its poses with other parameters than the nominal ones does little harm.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "heba/data/setup.h"
#include "heba/data/shared_effects.h"
#include "heba/robot/arm.h"

namespace heba {

// Returns the error of the gripper's pose as a function of the errors of all parameters of the arm, for joints at these
// positions (rad or m).
std::shared_ptr<const PoseEffect> MakeArmEffect(const Arm& nominal, const Eigen::VectorXd& joints,
                                                const Rigid3d& tip_from_gripper);

// Returns the derivative of the tangent of the gripper's pose (Tangent6: m, rad, in its own frame) by the positions of
// the joints.
Matrix6X GripperByJoints(const Arm& arm, const Eigen::VectorXd& joints, const Rigid3d& tip_from_gripper);

// The prior standard deviations with which the estimation of the groups' own ones starts.
inline constexpr double kOffsetPriorDeg = 0.3;
inline constexpr double kLengthPriorM = 0.5e-3;
inline constexpr double kAnglePriorDeg = 0.1;
// The least standard deviations of geometries that were not measured arm by arm: what machining and assembly leave.
inline constexpr double kLeastLengthM = 0.1e-3;
inline constexpr double kLeastAngleDeg = 0.01;
// The largest ones: more is another arm, or errors that are none of its geometry (docs/estimation.md).
inline constexpr double kMostLengthM = 1e-3;
inline constexpr double kMostAngleDeg = 0.17;
// Harmonic drives of the sizes in small and medium arms have stiffnesses of some 1e4 to 1e5 N m/rad (Harmonic Drive,
// catalogues of the CSG and SHG series); bearings and links add to their compliance.
inline constexpr double kCompliancePriorRadPerNm = 2e-5;

// The models of an arm's errors, each containing those before it.
enum class ArmErrorModel { kOffsets, kGeometry, kGravity };

// Returns the effects of a model: the offsets of the joints, with kGeometry also d, a, alpha, and beta where the next
// axis is parallel, and with kGravity also the compliances of the joints that yield (JointsThatYield; Arm::load must be
// known). Parameters that no captures can determine (UndeterminedParams) are not among them.
SharedEffects ArmErrors(const Arm& arm, ArmErrorModel model);

// Returns, for each joint, whether it turns and the torque of gravity about it is, in some posture, at least a
// twentieth of the greatest one of the arm. It is less if the axis is vertical, if the centre of mass is near the axis,
// and in a wrist without a payload: there, a compliance moves the tip by some 0.03 mm and can hardly be determined, so
// that an estimate would depend on its prior alone.
std::vector<bool> JointsThatYield(const Arm& arm);

// A parameter whose error cannot be told apart from something else, whatever the captures.
struct UndeterminedParam {
  int place = 0;     // ArmParamPlace.
  std::string with;  // The pose or parameter that has the same effect: "the hand-eye pose", "joint2.d".
};

// Returns the parameters that no captures can determine. The first joint and its d move like the pose of what is fixed
// in the base, the last joint's parameters like the pose of what is on the flange, and the parameters d of parallel
// axes, of which only the sum matters, like the first of them.
std::vector<UndeterminedParam> UndeterminedParams(const Arm& arm, Setup setup);
// Likewise, with these names for the poses of what is fixed in the base and of what is on the flange.
std::vector<UndeterminedParam> UndeterminedParams(const Arm& arm, const std::string& in_base,
                                                  const std::string& on_flange);

}  // namespace heba
