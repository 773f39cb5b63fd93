// What each view can serve: a pose of its own, a test of its points, or nothing.
#pragma once

#include <string>
#include <vector>

#include "heba/data/problem.h"
#include "solvers/target_pose.h"

namespace heba {

// Fewer points of a flat target tell no pose.
inline constexpr int kMinPosePoints = 4;

struct UnusedView {
  std::string name;
  std::string reason;
};

struct SortedViews {
  std::vector<View> posed;                     // Views with a pose of their own.
  std::vector<std::vector<TargetPose>> poses;  // Of each of them, the poses that its points allow.
  // Views whose points no pose of the target explains, or far worse than the others': some or all of them are wrong.
  std::vector<View> misfits;
  std::vector<std::string> misfit_reasons;
  std::vector<UnusedView> too_small;  // Views of fewer than kMinPosePoints points.
};

SortedViews SortViews(const std::vector<View>& views, const Camera& camera);

}  // namespace heba
