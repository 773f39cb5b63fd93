#include "heba/evaluation/run_result.h"

#include <algorithm>
#include <set>
#include <utility>

#include "heba/data/hand_eye.h"

namespace heba {

std::optional<PoseError> ErrorAt(const std::vector<std::optional<PoseError>>& errors, size_t place) {
  return errors.empty() ? std::nullopt : errors[place];
}

RunResult ShortResult(Setup setup, std::string target_type, int num_target_points) {
  RunResult result;
  result.rig = HandEyeProblem(setup, Camera(), TargetShape());
  result.target_types = {std::move(target_type)};
  result.num_target_points = {num_target_points};
  result.arms = {std::nullopt};
  result.working_points = {std::nullopt};
  result.errors.emplace_back();
  return result;
}

bool IsShort(const Problem& rig) { return rig.cameras.size() == 1 && rig.cameras.front().name.empty(); }

bool IsShort(const RunResult& result) { return IsShort(result.rig); }

const Estimate* FindRefined(const RunResult& result) {
  const auto found = std::find_if(result.estimates.rbegin(), result.estimates.rend(), [](const Estimate& estimate) {
    return estimate.ok && estimate.solution && estimate.method != kChainMethod &&
           estimate.solution->covariance.matrix.rows() >= 6;
  });
  return found == result.estimates.rend() ? nullptr : &*found;
}

const Estimate* FindFinal(const RunResult& result) {
  if (const Estimate* const refined = FindRefined(result)) return refined;
  const auto find = [&](std::string_view method) -> const Estimate* {
    const auto found = std::find_if(result.estimates.begin(), result.estimates.end(),
                                    [&](const Estimate& estimate) { return estimate.ok && estimate.method == method; });
    return found == result.estimates.end() ? nullptr : &*found;
  };
  const Estimate* const chain = find(kChainMethod);
  const Estimate* const two_step = find("two_step_ls");
  if (chain == nullptr && two_step == nullptr && !result.estimates.empty()) {
    const auto last = std::find_if(result.estimates.rbegin(), result.estimates.rend(),
                                   [](const Estimate& estimate) { return estimate.ok; });
    return last == result.estimates.rend() ? nullptr : &*last;
  }
  if (chain == nullptr || two_step == nullptr) return chain == nullptr ? two_step : chain;
  constexpr double kClearlyBetter = 0.7;
  const bool is_better = chain->errors.holdout_target_mm && two_step->errors.holdout_target_mm &&
                         *two_step->errors.holdout_target_mm < kClearlyBetter * *chain->errors.holdout_target_mm &&
                         two_step->errors.holdout_target_deg <= chain->errors.holdout_target_deg;
  return is_better ? two_step : chain;
}

const Estimate* FindBestClosedForm(const RunResult& result, FigureOf figure) {
  const Estimate* best = nullptr;
  for (const Estimate& estimate : result.estimates) {
    if (estimate.kind != EstimateKind::kClosedForm || !figure(estimate.errors)) continue;
    if (best == nullptr || *figure(estimate.errors) < *figure(best->errors)) best = &estimate;
  }
  return best;
}

const Estimate* EstimateWithArm(const RunResult& result) {
  const Estimate* found = nullptr;
  for (const Estimate& estimate : result.estimates) {
    if (estimate.method == kBundleMethod && (estimate.ok || found == nullptr)) found = &estimate;
    if (estimate.method == kChainMethod && estimate.ok) found = &estimate;
  }
  return found;
}

namespace {

// Returns a result of the short form with the poses, cameras, shapes and errors of an estimate.
RunResult WithFiguresOf(RunResult result, const Estimate& estimate) {
  PairSolution solution;
  solution.hand_eye = estimate.hand_eye;
  solution.camera = estimate.camera;
  if (estimate.solution) solution = *estimate.solution;
  result.rig = HandEyeProblem(SetupOf(result.rig.cameras[0].mount), solution);
  result.solution = ProblemSolution(solution);
  result.solution.captures.clear();
  CameraErrors errors;
  errors.reprojection_rms_px = estimate.errors.reprojection_rms_px;
  errors.holdout_rms_px = estimate.errors.holdout_rms_px;
  errors.holdout_target_mm = estimate.errors.holdout_target_mm;
  errors.holdout_target_deg = estimate.errors.holdout_target_deg;
  errors.left_out_rms_px = estimate.errors.left_out_rms_px;
  errors.left_out_target_mm = estimate.errors.left_out_target_mm;
  if (result.working_points[0]) errors.distance_m = result.working_points[0]->in_camera_m.norm();
  if (estimate.errors.truth) {
    errors.truth_mm = estimate.errors.truth->hand_eye_mm;
    errors.truth_deg = estimate.errors.truth->hand_eye_deg;
  }
  result.errors = {errors};
  result.holdout_chi2 = estimate.errors.holdout_chi2;
  return result;
}

}  // namespace

RunResult WithFinalEstimate(RunResult result) {
  const Estimate* const found = FindFinal(result);
  if (found == nullptr) return result;
  const Estimate estimate = *found;  // The copy outlives the result that is moved.
  return WithFiguresOf(std::move(result), estimate);
}

RunResult WithEstimate(RunResult result, const Estimate& estimate) {
  const Estimate* const with_arm = EstimateWithArm(result);
  if (with_arm == nullptr || with_arm->method != estimate.method) result.arms = {std::nullopt};
  return WithFiguresOf(std::move(result), estimate);
}

namespace {

// Returns the number of captures that an image for which `is_counted` holds belongs to.
int CountCaptures(const RunResult& result, bool (*is_counted)(const ImageResult& image)) {
  std::set<std::string> captures;
  for (const ImageResult& image : result.images) {
    if (is_counted(image)) captures.insert(image.capture);
  }
  return static_cast<int>(captures.size());
}

}  // namespace

int NumCaptures(const RunResult& result) {
  return CountCaptures(result, [](const ImageResult& image) { return !image.capture.empty(); });
}

int NumUsedCaptures(const RunResult& result) {
  return CountCaptures(result, [](const ImageResult& image) { return image.used; });
}

const RobotSummary* FindEstimatedArm(const RunResult& result, size_t robot) {
  if (robot >= result.arms.size() || !result.arms[robot]) return nullptr;
  return result.arms[robot]->is_estimated ? &*result.arms[robot] : nullptr;
}

std::string WhyNotEstimated(const RunResult& result, size_t robot) {
  const std::string& name = result.rig.robots[robot];
  std::string text = "the kinematics of the arm " + (name.empty() ? "" : name + " ") + "were not estimated";
  if (robot < result.arms.size() && result.arms[robot]) {
    return text + " (" + result.arms[robot]->reason.ToString() + ")";
  }
  if (name.empty()) return text + "; the config names no arm (robot.model)";
  return text + "; the config names no model of it (" +
         (result.rig.robots.size() == 1 ? "robot.model" : "robots." + name + ".model") + ")";
}

}  // namespace heba
