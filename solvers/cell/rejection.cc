#include "solvers/cell/rejection.h"

#include <algorithm>
#include <map>

#include "solvers/calibration/capture_clusters.h"
#include "solvers/calibration/capture_outliers.h"
#include "solvers/calibration/problem_model.h"
#include "solvers/cell/outliers.h"
#include "solvers/refine/fit.h"
#include "solvers/residuals/inliers.h"

namespace heba {
namespace {

// Tests the images one by one, until nothing changes. The images that the others do not contradict at an estimate
// without them are not tested again: two that contradict each other would otherwise take turns.
JudgedProblem LeaveOutEach(const Problem& problem, JudgedProblem at, const AdjustmentOptions& options) {
  const double least_p_value =
      kCaptureFalseAlarm / std::max(1, CountImages(problem, [](const ProblemImage&) { return true; }));
  constexpr int kMaxRounds = 30;
  ImageSet returned;
  for (int round = 0; round < kMaxRounds; ++round) {
    const Problem used = UsedPoints(problem, at);
    ImageSet next = at.left_out;
    for (const ImageVerdict& verdict : TestLeftOutImages(problem, used, at.solution)) {
      const std::pair<size_t, size_t> image{verdict.image.capture, verdict.image.image};
      if (verdict.p_value < least_p_value) {
        next.insert(image);
      } else if (next.erase(image) > 0) {
        returned.insert(image);
      }
    }
    // The worst contradiction of each camera and arm first: it makes others, of images that agree with nothing but it.
    std::map<std::pair<bool, size_t>, ImageVerdict> worst;
    for (const ImageVerdict& verdict : TestUsedImages(used, at.solution)) {
      if (verdict.p_value >= least_p_value) continue;
      if (!verdict.robot && returned.contains({verdict.image.capture, verdict.image.image})) continue;
      const size_t camera = problem.captures[verdict.image.capture].images[verdict.image.image].camera;
      const auto key = std::make_pair(verdict.robot.has_value(), verdict.robot.value_or(camera));
      const auto [found, is_new] = worst.emplace(key, verdict);
      if (!is_new && verdict.p_value < found->second.p_value) found->second = verdict;
    }
    for (const auto& [key, verdict] : worst) {
      if (!verdict.robot) next.insert({verdict.image.capture, verdict.image.image});
      if (!verdict.robot) continue;
      for (const size_t k : ImagesMovedBy(problem, verdict.image.capture, *verdict.robot)) {
        if (!returned.contains({verdict.image.capture, k})) next.insert({verdict.image.capture, k});
      }
    }
    if (next == at.left_out) break;
    Outcome<Solution> other =
        RefineProblem(StartingFrom(Without(problem, next), at.solution), at.solution.poses, options);
    if (!other) break;
    at = {std::move(*other), std::move(next)};
  }
  return at;
}

}  // namespace

ImageSet ImagesOfOthers(const Problem& problem, const ImageSet& images, size_t camera) {
  ImageSet of_others;
  for (const auto& [i, k] : images) {
    if (problem.captures[i].images[k].camera != camera) of_others.insert({i, k});
  }
  return of_others;
}

std::vector<size_t> ImagesMovedBy(const Problem& problem, size_t capture, size_t robot) {
  std::vector<size_t> moved;
  const std::vector<ProblemImage>& images = problem.captures[capture].images;
  for (size_t k = 0; k < images.size(); ++k) {
    if (images[k].observations.size() > 0 &&
        IsMovedBy(problem.cameras[images[k].camera].mount, problem.targets[images[k].target].mount, robot)) {
      moved.push_back(k);
    }
  }
  return moved;
}

JudgedProblem LeaveOutOutliers(const Problem& problem, JudgedProblem at, const AdjustmentOptions& options) {
  if (options.loss == LossKind::kNone) return at;
  return JudgeWithClusters(LeaveOutEach, problem, std::move(at), options);
}

Outcome<JudgedProblem> RefineWithoutOutliers(const Problem& problem, const CellPoses& start, ImageSet left_out,
                                             const AdjustmentOptions& options) {
  Outcome<Solution> solution = RefineProblem(Without(problem, left_out), start, options);
  if (!solution) return solution.failure();
  return LeaveOutOutliers(problem, {std::move(*solution), std::move(left_out)}, options);
}

}  // namespace heba
