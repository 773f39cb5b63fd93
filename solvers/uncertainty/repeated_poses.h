// Captures at one robot pose share one error of the robot, irrespective of how many images were taken there.
#pragma once

#include <vector>

#include "heba/data/problem.h"
#include "heba/evaluation/metrics.h"
#include "solvers/residuals/loop_problem.h"

namespace heba {

// Two robot poses that differ by less than the repeatability of an industrial arm are the same pose.
inline constexpr double kSamePoseM = 0.05e-3;
inline constexpr double kSamePoseRad = 1e-4;
// Likewise for joints, rad or m.
inline constexpr double kSameJoint = 1e-3;

// Groups views by robot pose, and by posture if the joints are known. Each view is in exactly one group, the groups are
// in the order of their first views, and a view belongs to the first group whose first view has the same pose.
PoseGroups GroupByRobotPose(Setup setup, const std::vector<View>& views);
PoseGroups GroupByRobotPose(Setup setup, const std::vector<PosePair>& pairs);

}  // namespace heba
