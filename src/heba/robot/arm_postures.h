// The postures of an arm: which positions of its joints reach a pose, in which configuration, and where it is singular.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/robot/arm.h"

namespace heba {

// The largest distance (m, rad) between a pose and the posture that counts as reaching it.
inline constexpr double kReached = 1e-7;

// Returns the posture nearest to `start` that reaches the pose: the Levenberg-Marquardt method, from `start`. Turning
// joints are not wrapped. Returns a Failure with the distance that remains if it does not converge to the pose.
Outcome<Eigen::VectorXd> PostureNear(const Arm& arm, const Rigid3d& base_from_tip, const Eigen::VectorXd& start);

// Returns the posture within the limits in which an arm of fewer than six joints comes next to a pose: the least sum of
// squares of distance (m) and angle (rad), from a few fixed starting points. Returns nothing if none of these leads to
// a posture within the limits.
std::optional<Eigen::VectorXd> NearestPostureTo(const Arm& arm, const Rigid3d& base_from_tip);

// Returns the postures that reach the pose, at most 16 for six joints, with angles in [-pi, pi]. Those of arms of
// Universal Robots' form are computed in closed form. Those of others are found numerically from fixed starting points
// and from the flips of those that were found, so that one may be missed. At a singularity, infinitely many postures
// may reach the pose; some of them are returned. Returns a Failure if none is found, or if the arm has more than six
// joints, which reach a pose in infinitely many ways.
Outcome<std::vector<Eigen::VectorXd>> PosturesOf(const Arm& arm, const Rigid3d& base_from_tip);

// Returns the posture with the turning joints that are beyond their limits moved by whole turns to where they are
// nearest to the middle of these. Returns the posture as it is if the limits are not known, and nothing if a joint
// stays beyond its limits.
std::optional<Eigen::VectorXd> WithinLimits(const Arm& arm, Eigen::VectorXd joints);

// Returns the postures that reach the pose within the limits of the joints, if these are known: those of PosturesOf or,
// of an arm with more than six joints, one of infinitely many, near the middle of the limits if that is possible.
// Joints that turn without limits are in [-pi, pi]. Returns a Failure if there is none.
Outcome<std::vector<Eigen::VectorXd>> PosturesWithinLimits(const Arm& arm, const Rigid3d& base_from_tip);

// Returns how far the joints move from one posture to another: the norm of their differences. Those of joints that turn
// without known limits count to the next whole turn.
double PostureDistance(const Arm& arm, const Eigen::VectorXd& a, const Eigen::VectorXd& b);

// Returns the origins of the frames that follow the joints, in the base, m.
std::vector<Eigen::Vector3d> OriginsOf(const Arm& arm, const Eigen::VectorXd& joints);

// The configuration of a posture, as controllers name it: the signs of shoulder, elbow and wrist. Two postures of
// different configurations are separated by a singularity.
using Configuration = std::array<bool, 3>;
// Returns nothing unless the arm has six turning joints, its axes 2 and 3 are parallel, and its axis 5 meets axes 4 and
// 6: only then do three signs name every posture.
std::optional<Configuration> ConfigurationOf(const Arm& arm, const Eigen::VectorXd& joints);
// Returns a configuration in words: "shoulder +, elbow -, wrist +".
std::string NameOf(const Configuration& configuration);

// Returns a description of the singularity at or close to a posture, or an empty string: the joints whose combined
// motion hardly moves the tip.
std::string SingularityAt(const Arm& arm, const Eigen::VectorXd& joints);

}  // namespace heba
