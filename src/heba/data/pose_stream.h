// The motion of a robot as a recorded stream of poses.
#pragma once

#include <vector>

#include "heba/geometry/rigid3.h"

namespace heba {

// The poses of the gripper at increasing times, at least two of them.
struct PoseStream {
  std::vector<double> times_s;
  std::vector<Rigid3d> base_from_gripper;  // One per time.
};

// Returns whether a time lies within those of a stream.
bool Covers(const PoseStream& stream, double time_s);

// Returns base_from_gripper at a time: the cubic through the two poses beside it, in the tangent space of the earlier
// one, whose slopes are those of the parabolas through three poses each. Before the first pose and after the last, the
// robot stands there.
Rigid3d PoseAt(const PoseStream& stream, double time_s);

// Returns the velocity of the gripper at a time, m/s and rad/s, in its own frame; zero before the first pose and after
// the last.
Tangent6 VelocityAt(const PoseStream& stream, double time_s);

}  // namespace heba
