#include "heba/cross_validation.h"

#include <algorithm>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "heba/base/error.h"
#include "heba/base/failure_code.h"
#include "heba/base/parallel.h"
#include "solvers/calibration/held_out.h"
#include "solvers/calibration/problem_model.h"
#include "solvers/cell/rejection.h"
#include "solvers/residuals/capture_loops.h"
#include "solvers/residuals/inliers.h"
#include "solvers/residuals/loss.h"

namespace heba {
namespace {

struct FoldErrors {
  std::vector<HeldOutErrors> of_cameras;
  // One per camera: the reason why its images were not held out; empty if they were.
  std::vector<Failure> reasons;
  SumOfSquares chi2;
};

using CameraSet = std::set<size_t>;

// Returns the problem with the points that a fold holds out, or with all others. The images of the cameras in `kept`
// are never held out. The captures keep their indices.
Problem PartOf(Problem problem, const std::vector<int>& fold_of, int fold, const CameraSet& kept, bool is_held_out) {
  for (size_t i = 0; i < problem.captures.size(); ++i) {
    for (ProblemImage& image : problem.captures[i].images) {
      const bool is_in_fold = fold_of[i] == fold && !kept.contains(image.camera);
      if (is_in_fold != is_held_out) image.observations = Observations();
    }
  }
  return problem;
}

// Returns the sets of cameras to keep if a fold fails, in the order in which to try them: each camera alone, then more
// and more of them, those with the fewest images first.
std::vector<CameraSet> CamerasToKeep(const Problem& problem) {
  std::vector<std::pair<int, size_t>> cameras;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    cameras.emplace_back(CountImages(problem, [&](const ProblemImage& image) { return image.camera == c; }), c);
  }
  std::sort(cameras.begin(), cameras.end());
  std::vector<CameraSet> sets;
  for (const auto& [num_images, camera] : cameras) sets.push_back({camera});
  CameraSet several = {cameras.front().second};
  for (size_t k = 1; k < cameras.size(); ++k) {
    several.insert(cameras[k].second);
    sets.push_back(several);
  }
  return sets;
}

// A fold's estimate, the cameras whose images it needs, and why it needs them.
struct FoldEstimate {
  Solution solution;
  CameraSet kept;
  Failure reason;
};

// Estimates without the images that a fold holds out. If the others do not suffice, because a camera has few images,
// the estimate also uses the held-out images of as few cameras as possible.
Outcome<FoldEstimate> EstimateFold(const Problem& problem, const CellPoses& start, const AdjustmentOptions& options,
                                   const std::vector<int>& fold_of, int fold) {
  Outcome<Solution> solution = RefineProblem(PartOf(problem, fold_of, fold, {}, false), start, options);
  if (solution) return FoldEstimate{std::move(*solution), {}, {}};
  const Failure reason = {FailureCode("of_fold"), {{"fold", fold + 1}}, {}, {solution.failure()}};
  for (const CameraSet& kept : CamerasToKeep(problem)) {
    solution = RefineProblem(PartOf(problem, fold_of, fold, kept, false), start, options);
    if (solution) return FoldEstimate{std::move(*solution), kept, reason};
  }
  return reason;
}

// Returns the fold that holds out each capture.
std::vector<int> FoldsOf(const Problem& problem, int num_folds) {
  std::vector<int> fold_of(problem.captures.size(), -1);
  const CaptureGroups groups = GroupByRobotPoses(problem);
  for (size_t g = 0; g < groups.size(); ++g) {
    for (const size_t i : groups[g]) fold_of[i] = static_cast<int>(g) % num_folds;
  }
  return fold_of;
}

// Returns the errors on the images of a problem, by a solution that was estimated without them. No camera has a reason.
FoldErrors ErrorsOnImages(const Problem& held_out, const Solution& solution) {
  FoldErrors errors;
  errors.of_cameras.resize(held_out.cameras.size());
  errors.reasons.resize(held_out.cameras.size());
  for (size_t i = 0; i < held_out.captures.size(); ++i) {
    const std::vector<Rigid3d> base_from_gripper = WithErrors(held_out.captures[i], solution.effects);
    for (const ProblemImage& image : held_out.captures[i].images) {
      if (image.observations.size() == 0) continue;
      const Camera& camera = solution.cameras[image.camera];
      const Observations points = ApplyShape(image.observations, solution.shapes[image.target]);
      errors.of_cameras[image.camera].AddImage(
          camera, CameraFromTarget(held_out, solution.poses, image.camera, image.target, base_from_gripper), points,
          EstimateTargetPose(camera, points), i);
    }
  }
  errors.chi2 = SquaresOf(held_out, solution, true);
  return errors;
}

// Returns the errors on the images that a fold holds out.
Outcome<FoldErrors> PredictFold(const Problem& problem, const CellPoses& start, const AdjustmentOptions& options,
                                const std::vector<int>& fold_of, int fold) {
  const Outcome<FoldEstimate> estimate = EstimateFold(problem, start, options, fold_of, fold);
  if (!estimate) return estimate.failure();
  FoldErrors errors = ErrorsOnImages(PartOf(problem, fold_of, fold, estimate->kept, true), estimate->solution);
  for (const size_t camera : estimate->kept) errors.reasons[camera] = estimate->reason;
  return errors;
}

// Returns the figures of a camera by the errors of all folds; `reason` says why it has none, or is empty.
CameraHoldOut HoldOutOf(const HeldOutErrors& errors, const Failure& reason) {
  CameraHoldOut camera;
  camera.reason = reason;
  if (!reason.empty()) return camera;
  if (errors.has_hidden) {
    camera.reason = FailureCode("hidden_held_out");
  } else {
    camera.rms_px = errors.pixels.RmsPx();
  }
  if (errors.num_poses == 0) {
    camera.reason = FailureCode("no_held_out_pose");
    return camera;
  }
  camera.target_m = errors.RmsDistanceM();
  camera.target_m_of_capture = errors.distance_m_of_capture;
  camera.target_rad = errors.RmsAngleRad();
  return camera;
}

// Returns the figures of `num_cameras` cameras; if a fold failed, none has any.
HoldOuts SumOfFolds(const std::vector<Outcome<FoldErrors>>& folds, size_t num_cameras) {
  HoldOuts result;
  FoldErrors all;
  all.of_cameras.resize(num_cameras);
  all.reasons.resize(num_cameras);
  for (const Outcome<FoldErrors>& fold : folds) {
    if (!fold) {
      CameraHoldOut failed;
      failed.reason = fold.failure();
      result.of_cameras.assign(num_cameras, failed);
      return result;
    }
    for (size_t c = 0; c < num_cameras; ++c) {
      all.of_cameras[c].Add(fold->of_cameras[c]);
      if (all.reasons[c].empty()) all.reasons[c] = fold->reasons[c];
    }
    all.chi2.Add(fold->chi2);
  }
  for (size_t c = 0; c < num_cameras; ++c) {
    result.of_cameras.push_back(HoldOutOf(all.of_cameras[c], all.reasons[c]));
  }
  result.chi2_per_dof = all.chi2.Mean();
  return result;
}

}  // namespace

HoldOuts CrossValidate(const Calibration& full, const CalibrationOptions& options, int num_folds,
                       const std::function<void()>& progress) {
  CHECK(full.refined.ok());
  // The points that the full adjustment rejected are no measure of its error.
  const Problem problem = StartingFrom(WithoutRejected(full.problem, *full.refined), *full.refined);
  const std::vector<int> fold_of = FoldsOf(problem, num_folds);
  AdjustmentOptions fold_options = StartingFromNoise(options.adjustment, *full.refined);
  fold_options.loss = OfInliers(options.adjustment.loss);
  fold_options.num_threads = 1;
  std::vector<Outcome<FoldErrors>> folds(static_cast<size_t>(num_folds));
  std::mutex mutex;
  ParallelFor(num_folds, options.adjustment.num_threads, [&](int fold) {
    folds[static_cast<size_t>(fold)] = PredictFold(problem, full.refined->poses, fold_options, fold_of, fold);
    const std::lock_guard<std::mutex> lock(mutex);
    progress();
  });
  return SumOfFolds(folds, problem.cameras.size());
}

}  // namespace heba
