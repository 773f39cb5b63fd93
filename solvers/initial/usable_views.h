// Classification of views by their number of points and their fit: usable for a pose, misfit, or too small.
#pragma once

#include <string>
#include <vector>

#include "heba/data/pair_problem.h"
#include "solvers/initial/target_pose.h"

namespace heba {

// Minimum number of points of a planar target that determine its pose.
inline constexpr int kMinPosePoints = 4;

struct SortedViews {
  std::vector<View> posed;                     // Views from which the target pose can be estimated.
  std::vector<std::vector<TargetPose>> poses;  // The possible poses of each of these views.
  // Views whose points are not explained by any pose of the target, or much worse than those of the other views: some
  // or all points are wrong.
  std::vector<View> misfits;
  std::vector<std::string> misfit_reasons;
  std::vector<View> too_small;  // Views with fewer than kMinPosePoints points.
};

// Classifies the views with the given camera; the robot poses are not used.
SortedViews SortViews(const std::vector<View>& views, const Camera& camera);

}  // namespace heba
