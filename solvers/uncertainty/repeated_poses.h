// Captures at one pose of the robot: its error there is one error, however often the camera looks.
#pragma once

#include <vector>

#include "heba/data/problem.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {

// Two poses of the robot that differ by less than an industrial arm's repeatability are one pose.
inline constexpr double kSamePoseM = 0.05e-3;
inline constexpr double kSamePoseRad = 1e-4;

// Indices of views, grouped by the robot's pose: each view is in exactly one group, the groups are in the order of
// their first views, and a view belongs to the first group whose first view has the same pose.
using PoseGroups = std::vector<std::vector<size_t>>;
PoseGroups GroupByRobotPose(Setup setup, const std::vector<View>& views);

// One LinearisedView a group: the rows of the group's views, in no more rows than it has columns, with one correction
// that they share. Views beyond those that the groups name (a prior's) follow as they are.
std::vector<LinearisedView> StackGroups(const std::vector<LinearisedView>& views, const PoseGroups& groups);

}  // namespace heba
