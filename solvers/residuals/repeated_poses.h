// Captures at one robot pose share one error of the robot, irrespective of how many images were taken there.
#pragma once

#include <vector>

#include "heba/data/pair_problem.h"
#include "heba/evaluation/metrics.h"
#include "solvers/residuals/loop_problem.h"

namespace heba {

// Two robot poses that differ by less than the repeatability of an industrial arm are the same pose.
inline constexpr double kSamePoseM = 0.05e-3;
inline constexpr double kSamePoseRad = 1e-4;
// Likewise for joints, rad or m.
inline constexpr double kSameJoint = 1e-3;

// The pose of an arm, and the joints by which it was reached; none if they are not known.
struct ReachedPose {
  Rigid3d base_from_gripper;
  std::vector<double> joints;
};
// The poses of all arms at one capture.
using ReachedPoses = std::vector<ReachedPose>;

// Groups captures by the poses of all arms, and by posture if the joints are known. Each capture is in exactly one
// group, the groups are in the order of their first captures, and a capture belongs to the first group whose first
// capture has the same poses.
PoseGroups GroupPoses(const std::vector<ReachedPoses>& captures);

// Likewise for the views, or the pairs, of one arm.
PoseGroups GroupByRobotPose(Setup setup, const std::vector<View>& views);
PoseGroups GroupByRobotPose(Setup setup, const std::vector<PosePair>& pairs);

}  // namespace heba
