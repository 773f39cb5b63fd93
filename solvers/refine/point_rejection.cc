#include "solvers/refine/point_rejection.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "heba/base/failure_code.h"
#include "solvers/refine/noise_iteration.h"
#include "solvers/residuals/inliers.h"

namespace heba {
namespace {

bool IsWhole(const std::vector<bool>& image) { return std::find(image.begin(), image.end(), false) == image.end(); }

// Returns flags for the points that pass their test at the estimate.
PointFlags FindInlierPoints(const Problem& problem, const Fit& fit) {
  const Problem weighted = WeightPoints(problem, fit.unmodelled_sigma_px);
  PointFlags flags = AllFlags(problem, false);
  for (size_t i = 0; i < weighted.captures.size(); ++i) {
    for (size_t k = 0; k < weighted.captures[i].images.size(); ++k) {
      const ProblemImage& image = weighted.captures[i].images[k];
      if (image.observations.size() == 0) continue;
      flags[i][k] = FindInliers(fit.state.cameras[image.camera], PredictedPose(problem, fit.state, {i, k}),
                                ApplyShape(image.observations, fit.state.shapes[image.target]),
                                std::hypot(fit.noise.pixel_px[image.camera], fit.noise.image_px[image.camera]));
    }
  }
  return flags;
}

}  // namespace

PointFlags AllFlags(const Problem& problem, bool value) {
  PointFlags flags;
  for (const ProblemCapture& capture : problem.captures) {
    std::vector<std::vector<bool>>& of_capture = flags.emplace_back();
    for (const ProblemImage& image : capture.images) {
      of_capture.emplace_back(static_cast<size_t>(image.observations.size()), value);
    }
  }
  return flags;
}

void UsePoints(const Problem& problem, const PointFlags& keep, Fit* fit) {
  const bool has_all = std::all_of(keep.begin(), keep.end(), [](const std::vector<std::vector<bool>>& capture) {
    return std::all_of(capture.begin(), capture.end(), IsWhole);
  });
  fit->problem = Borrowed(problem);
  if (!has_all) {
    auto kept = std::make_shared<Problem>(problem);
    for (size_t i = 0; i < kept->captures.size(); ++i) {
      for (size_t k = 0; k < kept->captures[i].images.size(); ++k) {
        Observations& observations = kept->captures[i].images[k].observations;
        if (!IsWhole(keep[i][k])) observations = KeepPoints(observations, keep[i][k]);
      }
    }
    fit->problem = std::move(kept);
  }
  fit->groups = GroupByRobotPoses(*fit->problem);
}

std::optional<Failure> CheckNumPoints(const Problem& problem, const PointFlags& keep) {
  int num_points = 0;
  for (const std::vector<std::vector<bool>>& capture : keep) {
    for (const std::vector<bool>& image : capture) {
      num_points += static_cast<int>(std::count(image.begin(), image.end(), true));
    }
  }
  // If there were as many unknowns as measurements, no noise would be averaged.
  const auto num_unknowns = static_cast<int>(UnknownsOf(problem).size());
  if (2 * num_points > num_unknowns) return std::nullopt;
  return Failure{FailureCode("few_coordinates"), {{"coordinates", 2.0 * num_points}, {"unknowns", num_unknowns}}};
}

Outcome<Fit> RefineWithRejection(const Problem& problem, Fit fit, const AdjustmentOptions& options, PointFlags* keep) {
  Outcome<Fit> settled = IterateNoiseAndFit(std::move(fit), LossOf(LossKind::kCauchy), NoiseScale::kMedian, options);
  constexpr int kMaxRounds = 20;
  for (int round = 0; settled && round < kMaxRounds; ++round) {
    PointFlags inliers = FindInlierPoints(problem, *settled);
    if (round > 0 && inliers == *keep) break;
    *keep = std::move(inliers);
    if (const std::optional<Failure> failure = CheckNumPoints(problem, *keep)) return *failure;
    Fit next = *settled;
    const std::vector<size_t> moving = MovingRobots(*next.problem);
    UsePoints(problem, *keep, &next);
    if (MovingRobots(*next.problem) != moving) {
      return Failure{FailureCode("points_contradict")};
    }
    settled = IterateNoiseAndFit(std::move(next), LossOf(LossKind::kNone), NoiseScale::kOfFit, options);
  }
  return settled;
}

}  // namespace heba
