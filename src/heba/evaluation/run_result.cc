#include "heba/evaluation/run_result.h"

#include "heba/base/error.h"
#include "heba/data/hand_eye.h"

namespace heba {
std::optional<PoseError> ErrorAt(const std::vector<std::optional<PoseError>>& errors, size_t place) {
  return errors.empty() ? std::nullopt : errors[place];
}

RunResult AsRunResult(const PairResult& result) {
  const Estimate* const refined = FindRefined(result);
  CHECK(refined != nullptr);
  return AsRunResult(result, *refined);
}

RunResult AsRunResult(const PairResult& result, const Estimate& estimate) {
  const Estimate* const refined = FindRefined(result);
  PairSolution solution;
  solution.hand_eye = estimate.hand_eye;
  solution.camera = estimate.camera;
  if (estimate.solution) solution = *estimate.solution;
  RunResult whole;
  whole.name = result.name;
  whole.about = result.about;
  whole.rig = HandEyeProblem(result.setup, solution);
  const bool has_arm = estimate.method == (refined != nullptr ? refined->method : kChainMethod);
  whole.arms = {has_arm ? result.robot : std::nullopt};
  whole.target_types = {result.target_type};
  whole.solution = ProblemSolution(solution);
  whole.solution.captures.clear();
  CameraErrors& errors = whole.errors.emplace_back();
  errors.reprojection_rms_px = estimate.errors.reprojection_rms_px;
  errors.holdout_rms_px = estimate.errors.holdout_rms_px;
  errors.holdout_target_mm = estimate.errors.holdout_target_mm;
  errors.holdout_target_deg = estimate.errors.holdout_target_deg;
  errors.left_out_rms_px = estimate.errors.left_out_rms_px;
  errors.left_out_target_mm = estimate.errors.left_out_target_mm;
  whole.working_points = {result.working_point};
  if (result.working_point) errors.distance_m = result.working_point->in_camera_m.norm();
  if (estimate.errors.truth) {
    errors.truth_mm = estimate.errors.truth->hand_eye_mm;
    errors.truth_deg = estimate.errors.truth->hand_eye_deg;
  }
  whole.holdout_chi2 = estimate.errors.holdout_chi2;
  for (const CaptureResult& capture : result.captures) {
    ImageResult& image = whole.images.emplace_back();
    image.capture = capture.image;
    image.image = capture.image;
    image.used = capture.used;
    image.reason = capture.reason;
    image.repeat_of = capture.repeat_of;
    image.was_searched = capture.was_searched;
    image.holdout_target_mm = capture.holdout_target_mm;
    image.move_without = capture.move_without;
    if (capture.num_points == 0) continue;
    image.targets.push_back({"", capture.num_points, capture.num_rejected, capture.rms_px, capture.used});
  }
  for (const Requirement& requirement : result.requirements) whole.requirements.push_back({0, requirement});
  whole.observations = result.observations;
  whole.point_deviations = result.point_deviations;
  whole.verdict = result.verdict;
  whole.timing = result.timing;
  return whole;
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
