// The use of estimated kinematics: where the gripper truly is, and which pose to command.
#pragma once

#include "heba/base/error.h"
#include "heba/evaluation/evaluation.h"

namespace heba {

// Returns the joints (rad or m) at which the controller reports a pose, in the configuration of the captures. Returns a
// Failure as TruePose does.
Outcome<Eigen::VectorXd> JointsAt(const RobotSummary& robot, const Rigid3d& reported);

// Returns the true pose of the gripper if the controller reports `reported` (base_from_gripper). The joints are those
// of the configuration of the captures. Returns a Failure if the arm does not reach the pose in it, or if the captures
// are in several configurations, so that the pose does not tell the joints.
Outcome<Rigid3d> TruePose(const RobotSummary& robot, const Rigid3d& reported);

// Likewise with the positions of the joints at that pose (rad or m), whatever the configurations of the captures.
// Returns a Failure if the arm is far from the pose with these joints.
Outcome<Rigid3d> TruePose(const RobotSummary& robot, const Rigid3d& reported, const Eigen::VectorXd& joints);

// Returns the pose to command so that the gripper truly reaches `wanted`: the inverse of TruePose.
Outcome<Rigid3d> CommandFor(const RobotSummary& robot, const Rigid3d& wanted);
// Likewise for the posture near these joints that reaches the pose. Returns a Failure if there is none.
Outcome<Rigid3d> CommandFor(const RobotSummary& robot, const Rigid3d& wanted, const Eigen::VectorXd& joints_near);

}  // namespace heba
