// Universal Robots' arms: where the flange is for given joints, and the joints that bring it to a given place.
//
// By Denavit and Hartenberg's standard parameters (1955), A_i = Rz(q_i) Tz(d_i) Tx(a_i) Rx(alpha_i) with alpha = pi/2,
// 0, 0, pi/2, -pi/2, 0: base_from_flange = A_1 ... A_6, the base's and the flange's axes as the maker's controller has
// them.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "heba/base/error.h"
#include "heba/geometry/rigid3.h"

namespace heba {

struct UrRobot {
  std::string name;  // Of ur_robots.def.
  double d1_m = 0;
  double a2_m = 0;
  double a3_m = 0;
  double d4_m = 0;
  double d5_m = 0;
  double d6_m = 0;
};

// In the order of ur_robots.def.
const std::vector<UrRobot>& UrRobots();
std::vector<std::string> UrRobotNames();
// Null if there is none of that name.
const UrRobot* FindUrRobot(std::string_view name);

using JointAngles = std::array<double, 6>;  // rad, from the base on.

Rigid3d BaseFromFlange(const UrRobot& robot, const JointAngles& joints_rad);

// One way to reach a pose.
struct UrPosture {
  JointAngles joints_rad = {};  // Each from -pi to pi.
  // Where the arm is singular there: what of it is free or next to free, in words. Empty if nothing is.
  std::string singularity;
};

// All postures that reach the pose, at most 8: shoulder left or right, wrist one way up or the other, elbow up or down.
// In the wrist's singularity (axes 4 and 6 parallel) joint 6 is free and stands at 0. A Failure that says why, and by
// how many mm, if the pose is out of reach.
Outcome<std::vector<UrPosture>> PosturesOf(const UrRobot& robot, const Rigid3d& base_from_flange);

}  // namespace heba
