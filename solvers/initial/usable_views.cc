#include "solvers/initial/usable_views.h"

#include <algorithm>

#include "heba/base/median.h"
#include "heba/base/text.h"

namespace heba {

SortedViews SortViews(const std::vector<View>& views, const Camera& camera) {
  SortedViews sorted;
  std::vector<View> posed;
  std::vector<std::vector<TargetPose>> poses;
  std::vector<double> rms_px;
  for (const View& view : views) {
    if (view.observations.size() < kMinPosePoints) {
      sorted.too_small.push_back(view);
      continue;
    }
    std::vector<TargetPose> found = EstimateTargetPose(camera, view.observations);
    if (found.empty()) {
      sorted.misfits.push_back(view);
      sorted.misfit_reasons.emplace_back("no pose of the target explains its points");
      continue;
    }
    rms_px.push_back(found.front().rms_px);
    posed.push_back(view);
    poses.push_back(std::move(found));
  }
  constexpr size_t kFewViews = 3;  // Fewer views have no typical residual.
  constexpr double kLeastMisfitPx = 3;
  constexpr double kMisfitRatio = 8;
  const double median_px = rms_px.size() < kFewViews ? 0 : Median({rms_px.begin(), rms_px.end()});
  const double limit_px = std::max(kLeastMisfitPx, kMisfitRatio * median_px);
  for (size_t i = 0; i < posed.size(); ++i) {
    if (rms_px.size() >= kFewViews && rms_px[i] > limit_px) {
      sorted.misfits.push_back(std::move(posed[i]));
      sorted.misfit_reasons.push_back("its points do not fit the target (" + Significant(rms_px[i], 2) +
                                      " px rms, the median of the captures is " + Significant(median_px, 2) +
                                      "): probably misread");
      continue;
    }
    sorted.posed.push_back(std::move(posed[i]));
    sorted.poses.push_back(std::move(poses[i]));
  }
  return sorted;
}

}  // namespace heba
