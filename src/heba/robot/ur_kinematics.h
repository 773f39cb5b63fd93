// Kinematics of Universal Robots' arms: the pose of the flange for given joints, and the joints that reach a given
// pose.
//
// The standard parameters of Denavit and Hartenberg (1955) are used, A_i = Rz(q_i) Tz(d_i) Tx(a_i) Rx(alpha_i) with
// alpha = pi/2, 0, 0, pi/2, -pi/2, 0, so that base_from_flange = A_1 ... A_6. The axes of the base and of the flange
// are those of the manufacturer's controller.
//
//   const heba::UrRobot& robot = *heba::FindUrRobot("ur5e");
//   const heba::Rigid3d base_from_flange = heba::BaseFromFlange(robot, {0, -1.57, 1.57, -1.57, -1.57, 0});
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/geometry/rigid3.h"

namespace heba {

struct UrRobot {
  std::string name;  // Name in ur_robots.def.
  double d1_m = 0;
  double a2_m = 0;
  double a3_m = 0;
  double d4_m = 0;
  double d5_m = 0;
  double d6_m = 0;
};

// Returns all arms, in the order of ur_robots.def.
const std::vector<UrRobot>& UrRobots();
std::vector<std::string> UrRobotNames();
// Returns null if there is no arm of that name.
const UrRobot* FindUrRobot(std::string_view name);

using JointAngles = std::array<double, 6>;  // rad, base first.

Rigid3d BaseFromFlange(const UrRobot& robot, const JointAngles& joints_rad);

// Returns all postures that reach the pose, at most 8, with joints in [-pi, pi]: shoulder left or right, wrist flipped
// or not, elbow up or down. In the singularity of the wrist (axes 4 and 6 parallel), joint 6 is free and is set to 0.
// Returns a Failure with the reason and the distance in mm if the pose is out of reach.
Outcome<std::vector<JointAngles>> PosturesOf(const UrRobot& robot, const Rigid3d& base_from_flange);

}  // namespace heba
