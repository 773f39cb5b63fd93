// Views sorted by their use: a pose of their own, a test of their points, or none.
#pragma once

#include <string>
#include <vector>

#include "heba/data/problem.h"
#include "solvers/initial/target_pose.h"

namespace heba {

// Fewer points of a flat target tell no pose.
inline constexpr int kMinPosePoints = 4;

struct UnusedView {
  std::string name;
  std::string reason;
};

struct SortedViews {
  std::vector<View> posed;                     // Views with a pose of their own.
  std::vector<std::vector<TargetPose>> poses;  // The poses that each view's points allow.
  // Views whose points no pose of the target explains, or far worse than the others': some or all of them are wrong.
  std::vector<View> misfits;
  std::vector<std::string> misfit_reasons;
  std::vector<UnusedView> too_small;  // Views of fewer than kMinPosePoints points.
};

SortedViews SortViews(const std::vector<View>& views, const Camera& camera);

}  // namespace heba
