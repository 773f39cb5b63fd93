#include "solvers/refine/point_rejection.h"

#include <algorithm>
#include <memory>

#include "solvers/refine/noise_iteration.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/noise_scale.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {
namespace {

// Returns flags for the points that pass their test at the estimate.
PointFlags FindInlierPoints(const Problem& problem, const FreeUnknowns& free, const Fit& fit) {
  std::vector<View> views = problem.views;
  if (fit.unmodelled_sigma_px) WeightByCovariance(*fit.unmodelled_sigma_px, &views);
  PointFlags flags;
  for (size_t i = 0; i < views.size(); ++i) {
    flags.push_back(FindInliers(fit.state.camera, PredictedPose(problem, free, fit.state, i),
                                ApplyShape(views[i].observations, fit.state.shape), fit.noise.pixel_px));
  }
  return flags;
}

}  // namespace

SharedProblem KeepFlaggedPoints(const Problem& problem, const PointFlags& keep) {
  const auto is_whole = [](const std::vector<bool>& view) {
    return std::find(view.begin(), view.end(), false) == view.end();
  };
  if (std::all_of(keep.begin(), keep.end(), is_whole)) return Borrowed(problem);
  auto kept = std::make_shared<Problem>(problem);
  for (size_t i = 0; i < kept->views.size(); ++i) {
    if (!is_whole(keep[i])) kept->views[i].observations = KeepPoints(problem.views[i].observations, keep[i]);
  }
  return kept;
}

int CountFlags(const PointFlags& flags) {
  int count = 0;
  for (const std::vector<bool>& view : flags) count += static_cast<int>(std::count(view.begin(), view.end(), true));
  return count;
}

std::optional<Failure> CheckNumPoints(int num_points, const UnknownLayout& unknowns) {
  // If there were as many unknowns as measurements, no noise would be averaged.
  const auto num_unknowns = static_cast<int>(unknowns.size());
  if (2 * num_points > num_unknowns) return std::nullopt;
  return Failure{std::to_string(2 * num_points) + " measured coordinates for " + std::to_string(num_unknowns) +
                 " unknowns are too few; take more captures or hold the intrinsics"};
}

Outcome<Fit> RefineWithRejection(const Problem& problem, Fit fit, const FreeUnknowns& free,
                                 const BundleOptions& options, PointFlags* keep) {
  Outcome<Fit> settled =
      IterateNoiseAndFit(std::move(fit), free, LossOf(LossKind::kCauchy), NoiseScale::kMedian, options);
  if (!settled) return settled;
  constexpr int kMaxRounds = 20;
  for (int round = 0; round < kMaxRounds; ++round) {
    PointFlags inliers = FindInlierPoints(problem, free, *settled);
    if (round > 0 && inliers == *keep) break;
    *keep = std::move(inliers);
    const int num_kept = CountFlags(*keep);
    if (const std::optional<Failure> failure = CheckNumPoints(num_kept, HandEyeUnknowns(problem.camera.Model(), free)))
      return *failure;
    Fit next = *settled;
    next.problem = KeepFlaggedPoints(problem, *keep);
    settled = IterateNoiseAndFit(std::move(next), free, LossOf(LossKind::kNone), NoiseScale::kOfFit, options);
    if (!settled) return settled;
  }
  return settled;
}

}  // namespace heba
