#include "solvers/cell/rejection.h"

#include <algorithm>
#include <map>

#include "solvers/calibration/capture_clusters.h"
#include "solvers/calibration/capture_outliers.h"
#include "solvers/calibration/problem_model.h"
#include "solvers/cell/outliers.h"
#include "solvers/refine/fit.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/loss.h"

namespace heba {
namespace {

// Adjusts without these images. The points that `at` rejected are left out, and no others are looked for.
Outcome<JudgedProblem> RefineInliers(const Problem& problem, const JudgedProblem& at, ImageSet left_out,
                                     const AdjustmentOptions& options_in) {
  AdjustmentOptions options = options_in;
  options.loss = OfInliers(options.loss);
  const Problem used = WithoutRejected(Without(problem, left_out), at.solution);
  Outcome<Solution> solution = RefineProblem(StartingFrom(used, at.solution), at.solution.poses, options);
  if (!solution) return solution.failure();
  return JudgedProblem{WithRejectedBefore(*std::move(solution), at.solution), std::move(left_out)};
}

// The images to leave out by the tests of all images at an adjustment, and those that others did not contradict at an
// adjustment without them.
struct TestedImages {
  ImageSet left_out;
  ImageSet returned;
};

// Tests all images at an adjustment. Those that were returned before are not tested again: two that contradict each
// other would otherwise take turns.
TestedImages TestImages(const Problem& problem, const JudgedProblem& at, ImageSet returned) {
  const double least_p_value =
      kCaptureFalseAlarm / std::max(1, CountImages(problem, [](const ProblemImage&) { return true; }));
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
  return {std::move(next), std::move(returned)};
}

// Tests the images one by one, until nothing changes. Points are looked for that contradict the others when the images
// have settled, which may unsettle them.
JudgedProblem LeaveOutEach(const Problem& problem, JudgedProblem at, const AdjustmentOptions& options) {
  constexpr int kMaxRounds = 30;
  ImageSet returned;
  bool are_points_judged = true;
  JudgedProblem last_judged = at;
  for (int round = 0; round < kMaxRounds || !are_points_judged; ++round) {
    ImageSet next = at.left_out;
    if (round < kMaxRounds) {
      TestedImages tested = TestImages(problem, at, std::move(returned));
      next = std::move(tested.left_out);
      returned = std::move(tested.returned);
    }
    const bool has_settled = next == at.left_out;
    if (has_settled && are_points_judged) break;
    if (!has_settled) {
      if (Outcome<JudgedProblem> other = RefineInliers(problem, at, next, options)) {
        at = std::move(*other);
        are_points_judged = false;
        continue;
      }
    }
    Outcome<Solution> other =
        RefineProblem(StartingFrom(Without(problem, next), at.solution), at.solution.poses, options);
    if (!other) return last_judged;
    at = {std::move(*other), std::move(next)};
    last_judged = at;
    are_points_judged = true;
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
