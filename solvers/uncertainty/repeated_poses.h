// Captures at one robot pose share one error of the robot, irrespective of how many images were taken there.
#pragma once

#include <vector>

#include "heba/data/problem.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {

// Two robot poses that differ by less than the repeatability of an industrial arm are the same pose.
inline constexpr double kSamePoseM = 0.05e-3;
inline constexpr double kSamePoseRad = 1e-4;

// Indices of views, grouped by robot pose. Each view is in exactly one group, the groups are in the order of their
// first views, and a view belongs to the first group whose first view has the same pose.
using PoseGroups = std::vector<std::vector<size_t>>;
PoseGroups GroupByRobotPose(Setup setup, const std::vector<View>& views);

// Returns one LinearisedView per group: the rows of the group's views, reduced to at most as many rows as columns,
// with one correction that they share. Views that belong to no group (those of a prior) must come last; they are
// appended unchanged.
std::vector<LinearisedView> StackGroups(const std::vector<LinearisedView>& views, const PoseGroups& groups);

}  // namespace heba
