#include "heba/evaluation/run_result.h"

#include <algorithm>
#include <cmath>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/data/hand_eye.h"
#include "heba/evaluation/judgement.h"
#include "heba/evaluation/limits.h"

namespace heba {
namespace {

std::pair<std::string, std::string> CameraName(const RunResult& result, size_t camera) {
  return {"of_camera", result.rig.cameras[camera].name};
}

// Returns the largest sigma of a pose's translation or rotation.
double LargestSigma(const Eigen::Matrix<double, 6, 6>& covariance, Eigen::Index first) {
  return std::sqrt(covariance.diagonal().segment<3>(first).maxCoeff());
}

// Returns whether a requirement takes the place of the built-in limits of a camera.
bool IsRequired(const RunResult& result, const std::string& camera) {
  return std::any_of(result.requirements.begin(), result.requirements.end(),
                     [&](const CameraRequirement& entry) { return result.rig.cameras[entry.camera].name == camera; });
}

// Returns the distance between a camera and its targets.
double DistanceOf(const RunResult& result, size_t camera) {
  const bool is_known = camera < result.errors.size() && result.errors[camera].distance_m;
  return std::max(kLeastDistanceM, is_known ? *result.errors[camera].distance_m : kUsualDistanceM);
}

// Returns RobotErrorShare of the worst arm of the cell.
double RobotErrorShareOf(const RunResult& result, size_t camera) {
  double worst = 0;
  for (size_t robot = 0; robot < result.solution.robot_noise.size(); ++robot) {
    worst = std::max(worst, RobotErrorShare(result.solution.robot_noise[robot], SmoothNoiseOf(result.solution, robot),
                                            DistanceOf(result, camera)));
  }
  return worst;
}

int NumUsed(const RunResult& result, size_t camera) {
  return static_cast<int>(std::count_if(result.images.begin(), result.images.end(), [&](const ImageResult& image) {
    return image.used && image.camera == result.rig.cameras[camera].name;
  }));
}

Finding JudgeUncertainty(const RunResult& result) {
  Finding worst;
  double worst_mm = -1;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const auto covariance = PoseCovarianceOf(result.solution.covariance, CameraPoseBlock(result.rig.cameras[c]));
    if (!covariance) continue;
    const double mm = 1000 * LargestSigma(*covariance, 0);
    const double deg = RadToDeg(LargestSigma(*covariance, 3));
    const Grade grade = IsRequired(result, result.rig.cameras[c].name)
                            ? Grade::kGood
                            : GradeOfSigma(std::max(1e-3 * mm / DistanceOf(result, c), DegToRad(deg)),
                                           RobotErrorShareOf(result, c), NumUsed(result, c));
    if (grade < worst.grade || (grade == worst.grade && mm <= worst_mm)) continue;
    worst_mm = mm;
    worst = {
        grade, FindingCode("uncertainty"), {{"position_mm", mm}, {"orientation_deg", deg}}, {CameraName(result, c)}};
  }
  return worst;
}

// Judges the worst camera of those with hold-out errors, and names those without.
std::vector<Finding> JudgeHoldOut(const RunResult& result) {
  std::vector<Finding> findings;
  for (size_t c = 0; c < result.errors.size(); ++c) {
    const CameraErrors& errors = result.errors[c];
    if (errors.holdout_reason.empty() || errors.holdout_target_mm) continue;
    findings.push_back(
        {Grade::kDoubtful, FindingCode("no_hold_out"), {}, {CameraName(result, c), {"reason", "failed_for_camera"}}});
    findings.back().reason = errors.holdout_reason;
  }
  Finding worst{Grade::kDoubtful, FindingCode("no_hold_out"), {}, {{"reason", "none_held_out"}}};
  double worst_mm = -1;
  for (size_t c = 0; c < result.errors.size(); ++c) {
    const CameraErrors& errors = result.errors[c];
    if (!errors.holdout_target_mm || !errors.holdout_target_deg) continue;
    const Grade grade = IsRequired(result, result.rig.cameras[c].name)
                            ? Grade::kGood
                            : GradeOfHeldOut(1e-3 * *errors.holdout_target_mm / DistanceOf(result, c),
                                             *errors.holdout_target_deg, RobotErrorShareOf(result, c));
    const bool is_first = worst_mm < 0;
    if (!is_first && (grade < worst.grade || (grade == worst.grade && *errors.holdout_target_mm <= worst_mm))) continue;
    worst_mm = *errors.holdout_target_mm;
    worst = {grade,
             FindingCode("hold_out"),
             {{"target_mm", *errors.holdout_target_mm}, {"target_deg", *errors.holdout_target_deg}},
             {CameraName(result, c)}};
  }
  if (worst_mm >= 0 || findings.empty()) findings.push_back(std::move(worst));
  return findings;
}

// `of_hold_out`: the worst grade of the held-out errors.
std::optional<Finding> JudgeModel(const RunResult& result, Grade of_hold_out) {
  if (!result.holdout_chi2) return std::nullopt;
  const bool has_noise = std::any_of(result.solution.robot_noise.begin(), result.solution.robot_noise.end(),
                                     [](const auto& noise) { return noise.has_value(); });
  return Finding{GradeOfMisfit(*result.holdout_chi2, of_hold_out),
                 FindingCode("unmodelled_error"),
                 {{"chi2_per_dof", *result.holdout_chi2}},
                 {{"robot_noise", has_noise ? "modelled" : "none"}}};
}

// Judges the camera that uses the smallest share of its images, or the fewest.
Finding JudgeImages(const RunResult& result) {
  Finding worst;
  double worst_share = -1;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const int num_used = NumUsed(result, c);
    int num_seen = 0;
    int num_images = 0;
    for (const ImageResult& image : result.images) {
      if (image.camera != result.rig.cameras[c].name || !image.was_searched) continue;
      ++num_images;
      num_seen += image.targets.empty() ? 0 : 1;
    }
    const double left_out = num_seen > 0 ? 1 - static_cast<double>(num_used) / num_seen : 1;
    const bool is_few = num_used < kFewCaptures;
    const Grade grade = std::max(GradeOf(left_out, kShareLeftOut), is_few ? Grade::kDoubtful : Grade::kGood);
    if (worst_share >= 0 && (grade < worst.grade || (grade == worst.grade && left_out <= worst_share))) continue;
    worst_share = left_out;
    worst = {grade,
             is_few ? FindingCode("few_captures") : FindingCode("captures_left_out"),
             {{"used", num_used}, {"seen", num_seen}, {"captures", num_images}, {"copies", 0}},
             {CameraName(result, c)}};
    if (c < result.errors.size()) AddLeftOut(result.errors[c].left_out_target_mm, &worst);
  }
  return worst;
}

Finding JudgePixels(const RunResult& result) {
  const std::vector<double>& sigmas = result.solution.pixel_sigmas_px;
  const auto worst = std::max_element(sigmas.begin(), sigmas.end());
  return {GradeOf(*worst, kPixelSigmaPx),
          FindingCode("pixel_noise"),
          {{"pixel_sigma_px", *worst}},
          {CameraName(result, static_cast<size_t>(worst - sigmas.begin()))}};
}

// Judges the influence of the captures on each camera.
std::vector<Finding> JudgeInfluence(const RunResult& result) {
  std::vector<Finding> findings;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    std::vector<NamedMove> moves;
    for (const ImageResult& image : result.images) {
      if (image.camera == result.rig.cameras[c].name && image.move_without) {
        moves.push_back({image.capture, *image.move_without});
      }
    }
    std::optional<Finding> finding =
        JudgeMoves(moves, std::max(kLeastDistanceM, result.errors[c].distance_m.value_or(kUsualDistanceM)));
    if (!finding) continue;
    finding->names.push_back(CameraName(result, c));
    findings.push_back(std::move(*finding));
  }
  return findings;
}

// Makes the weak direction of the same camera, if there is one, part of an uncertainty that is not good: it contains
// the remedy.
void TakeWeakDirection(std::vector<Finding>* findings, Finding* uncertainty) {
  if (uncertainty->grade == Grade::kGood) return;
  const auto weak = std::find_if(findings->begin(), findings->end(), [&](const Finding& finding) {
    return finding.code == FindingCode("weak_direction") && finding.grade != Grade::kGood &&
           finding.Name("of_camera") == uncertainty->Name("of_camera");
  });
  if (weak == findings->end()) return;
  uncertainty->numbers.insert(uncertainty->numbers.end(), weak->numbers.begin(), weak->numbers.end());
  uncertainty->parts.push_back(std::move(*weak));
  findings->erase(weak);
}

// Judges the requirements, each for every camera that it concerns.
std::vector<Finding> JudgeRequirements(const RunResult& result) {
  std::vector<Finding> findings;
  for (const CameraRequirement& of_camera : result.requirements) {
    Finding& finding = findings.emplace_back(
        JudgeRequirement(of_camera.requirement, result.errors[of_camera.camera].holdout_target_mm));
    finding.names.push_back(CameraName(result, of_camera.camera));
  }
  return findings;
}

}  // namespace

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

Verdict JudgeRun(const RunResult& result) {
  Verdict verdict;
  std::vector<Finding>& findings = verdict.findings;
  findings = result.observations;
  std::erase_if(findings, [&](const Finding& finding) {
    return finding.code == FindingCode("weak_direction") && IsRequired(result, finding.Name("of_camera").value_or(""));
  });
  for (Finding& finding : JudgeRequirements(result)) findings.push_back(std::move(finding));
  Grade of_hold_out = Grade::kGood;
  for (Finding& finding : JudgeHoldOut(result)) {
    if (finding.code == FindingCode("hold_out")) of_hold_out = std::max(of_hold_out, finding.grade);
    findings.push_back(std::move(finding));
  }
  if (std::optional<Finding> model = JudgeModel(result, of_hold_out)) findings.push_back(std::move(*model));
  Finding uncertainty = JudgeUncertainty(result);
  TakeWeakDirection(&findings, &uncertainty);
  findings.push_back(std::move(uncertainty));
  findings.push_back(JudgeImages(result));
  findings.push_back(JudgePixels(result));
  for (Finding& finding : JudgeInfluence(result)) findings.push_back(std::move(finding));
  GatherSymptoms(&findings);
  SortFindings(&findings);
  verdict.grade = findings.front().grade;
  return verdict;
}

}  // namespace heba
