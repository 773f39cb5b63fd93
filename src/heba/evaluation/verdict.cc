#include "heba/evaluation/verdict.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/evaluation/judgement.h"
#include "heba/evaluation/limits.h"

namespace heba {
namespace {

// A closed form predicts held-out captures better than the refinement if the ratio of their errors is below this
// factor.
constexpr double kClosedFormBetter = 0.85;

// Returns the name of a camera in findings; empty for the only camera of a pair, whose findings name none.
std::string NameInFindings(const RunResult& result, size_t camera) {
  return result.estimates.empty() ? result.rig.cameras[camera].name : "";
}

// Returns a finding with the name of the camera that it is about, unless the camera has none.
Finding WithCamera(Finding finding, const RunResult& result, size_t camera) {
  const std::string name = NameInFindings(result, camera);
  if (!name.empty()) finding.names.emplace_back("of_camera", name);
  return finding;
}

// Returns whether a finding is about this camera; one that names none is about the only one.
bool IsAbout(const RunResult& result, const Finding& finding, size_t camera) {
  return finding.Name("of_camera").value_or("") == NameInFindings(result, camera);
}

// Says how the noise of the robot was modelled, on which the remedy of a systematic error depends.
std::pair<std::string, std::string> RobotNoiseName(const RunResult& result) {
  const std::vector<std::optional<RobotNoise>>& noises = result.solution.robot_noise;
  const bool has_noise = std::any_of(noises.begin(), noises.end(), [](const auto& noise) { return noise.has_value(); });
  return {"robot_noise", has_noise ? "modelled" : "none"};
}

// Returns the largest of three sigmas of a pose's translation or rotation.
double LargestSigma(const Eigen::Matrix<double, 6, 6>& covariance, Eigen::Index first) {
  return std::sqrt(covariance.diagonal().segment<3>(first).maxCoeff());
}

// Returns whether a requirement takes the place of the built-in limits of a camera.
bool IsRequired(const RunResult& result, size_t camera) {
  return std::any_of(result.requirements.begin(), result.requirements.end(),
                     [&](const CameraRequirement& entry) { return entry.camera == camera; });
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

bool IsOf(const RunResult& result, const ImageResult& image, size_t camera) {
  return image.camera == result.rig.cameras[camera].name;
}

int NumUsed(const RunResult& result, size_t camera) {
  return static_cast<int>(std::count_if(result.images.begin(), result.images.end(), [&](const ImageResult& image) {
    return image.used && IsOf(result, image, camera);
  }));
}

// Returns the uncertainty of a camera without its grade, and its largest effect on a target in mm.
std::optional<std::pair<Finding, double>> UncertaintyOf(const RunResult& result, size_t camera) {
  const ProblemCamera& of_problem = result.rig.cameras[camera];
  const Covariance& covariance = result.solution.covariance;
  const auto of_pose = PoseCovarianceOf(covariance, CameraPoseBlock(of_problem));
  if (!of_pose) return std::nullopt;
  const double mm = 1000 * LargestSigma(*of_pose, 0);
  const double deg = RadToDeg(LargestSigma(*of_pose, 3));
  Finding finding = WithCamera(
      {Grade::kGood, FindingCode("uncertainty"), {{"position_mm", mm}, {"orientation_deg", deg}}}, result, camera);
  // A target is located by all unknowns together, whose errors partly cancel.
  double largest_mm = std::max(mm, 1000 * DistanceOf(result, camera) * DegToRad(deg));
  const bool has_working_point = camera < result.working_points.size() && result.working_points[camera];
  const WorkingPoint* const working_point = has_working_point ? &*result.working_points[camera] : nullptr;
  if (working_point != nullptr) {
    largest_mm = 1000 * std::sqrt(working_point->covariance_m2.diagonal().maxCoeff());
    finding.numbers.emplace_back("at_work_mm", largest_mm);
    Finding& at_work = finding.parts.emplace_back(Finding{Grade::kGood, FindingCode("at_working_point")});
    at_work.numbers = {{"distance_mm", 1000 * working_point->in_camera_m.norm()}, {"at_work_mm", largest_mm}};
  }
  const bool is_held = covariance.layout.Block(CameraBlock(of_problem)).size == 0;
  if (is_held && !result.solution.cameras[camera].params.empty()) {
    Finding& held = finding.parts.emplace_back(Finding{Grade::kGood, FindingCode("intrinsics_not_included")});
    if (working_point != nullptr) {
      // A relative error of the focal length moves a target along its ray by the same relative amount.
      constexpr double kShare = 1e-3;
      held.numbers = {{"focal_error_percent", 100 * kShare},
                      {"moves_target_mm", 1000 * kShare * working_point->in_camera_m.norm()}};
    }
  }
  return std::pair{std::move(finding), largest_mm};
}

// Returns the uncertainty of the worst camera; nothing if no camera has one.
std::optional<Finding> JudgeUncertainty(const RunResult& result) {
  std::optional<Finding> worst;
  double worst_mm = 0;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    std::optional<std::pair<Finding, double>> of_camera = UncertaintyOf(result, c);
    if (!of_camera) continue;
    auto& [finding, largest_mm] = *of_camera;
    const double share = 1e-3 * largest_mm / DistanceOf(result, c);
    if (!IsRequired(result, c)) {
      finding.grade = GradeOfSigma(share, RobotErrorShareOf(result, c), NumUsed(result, c));
    }
    if (worst && (finding.grade < worst->grade || (finding.grade == worst->grade && largest_mm <= worst_mm))) continue;
    worst_mm = largest_mm;
    worst = std::move(finding);
  }
  return worst;
}

// The findings about held-out captures, and the worst grade of their errors by the built-in limits.
struct HoldOutFindings {
  std::vector<Finding> findings;
  Grade grade = Grade::kGood;
};

// Judges the worst camera of those with hold-out errors, and names those without.
HoldOutFindings JudgeHoldOut(const RunResult& result) {
  HoldOutFindings judged;
  for (size_t c = 0; c < result.errors.size(); ++c) {
    const CameraErrors& errors = result.errors[c];
    if (errors.holdout_reason.empty() || errors.holdout_target_mm) continue;
    Finding& missing =
        judged.findings.emplace_back(WithCamera({Grade::kDoubtful, FindingCode("no_hold_out")}, result, c));
    missing.names.emplace_back("reason", "failed_for_camera");
    missing.reason = errors.holdout_reason;
  }
  std::optional<Finding> worst;
  double worst_mm = 0;
  for (size_t c = 0; c < result.errors.size(); ++c) {
    const std::optional<double>& mm = result.errors[c].holdout_target_mm;
    const std::optional<double>& deg = result.errors[c].holdout_target_deg;
    if (!mm || !deg) continue;
    const Grade of_limits = GradeOfHeldOut(1e-3 * *mm / DistanceOf(result, c), *deg, RobotErrorShareOf(result, c));
    judged.grade = std::max(judged.grade, of_limits);
    const Grade grade = IsRequired(result, c) ? Grade::kGood : of_limits;
    if (worst && (grade < worst->grade || (grade == worst->grade && *mm <= worst_mm))) continue;
    worst_mm = *mm;
    worst = WithCamera({grade, FindingCode("hold_out"), {{"target_mm", *mm}, {"target_deg", *deg}}}, result, c);
  }
  if (worst) {
    judged.findings.push_back(std::move(*worst));
  } else if (judged.findings.empty()) {
    judged.findings.push_back({Grade::kDoubtful, FindingCode("no_hold_out"), {}, {{"reason", "none_held_out"}}});
  }
  return judged;
}

// `of_hold_out`: the worst grade of the held-out errors.
std::optional<Finding> JudgeModel(const RunResult& result, Grade of_hold_out) {
  if (!result.holdout_chi2) return std::nullopt;
  return Finding{GradeOfMisfit(*result.holdout_chi2, of_hold_out),
                 FindingCode("unmodelled_error"),
                 {{"chi2_per_dof", *result.holdout_chi2}},
                 {RobotNoiseName(result)}};
}

// Judges the camera that uses the smallest share of its images, or the fewest. Images without a target, and copies of
// others, do not count as left out.
Finding JudgeImages(const RunResult& result) {
  std::optional<Finding> worst;
  double worst_share = 0;
  // Few captures are enough beside those of an earlier run.
  const bool builds_on_other = result.rig.cameras.size() == 1 &&
                               std::any_of(result.observations.begin(), result.observations.end(),
                                           [](const Finding& finding) { return finding.code == FindingCode("prior"); });
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const int num_used = NumUsed(result, c);
    int num_seen = 0;
    int num_copies = 0;
    int num_listed = 0;
    for (const ImageResult& image : result.images) {
      if (!IsOf(result, image, c) || !image.was_searched) continue;
      ++num_listed;
      const bool is_copy = !image.repeat_of.empty();
      num_copies += is_copy ? 1 : 0;
      num_seen += !is_copy && (image.used || !image.targets.empty()) ? 1 : 0;
    }
    const double left_out = num_seen > 0 ? 1 - static_cast<double>(num_used) / num_seen : 1;
    const bool is_few = num_used < kFewCaptures && !builds_on_other;
    const Grade grade = std::max(GradeOf(left_out, kShareLeftOut), is_few ? Grade::kDoubtful : Grade::kGood);
    if (worst && (grade < worst->grade || (grade == worst->grade && left_out <= worst_share))) continue;
    worst_share = left_out;
    worst = WithCamera(
        {grade,
         is_few ? FindingCode("few_captures") : FindingCode("captures_left_out"),
         {{"used", num_used}, {"seen", num_seen}, {"captures", num_listed - num_copies}, {"copies", num_copies}}},
        result, c);
    const auto left_out_mm = c < result.errors.size() ? result.errors[c].left_out_target_mm : std::nullopt;
    if (left_out_mm) worst->numbers.emplace_back("left_out_mm", *left_out_mm);
  }
  CHECK(worst.has_value()) << "a result without a camera";
  return *worst;
}

Finding JudgePixels(const RunResult& result) {
  const std::vector<double>& sigmas = result.solution.pixel_sigmas_px;
  const auto worst = std::max_element(sigmas.begin(), sigmas.end());
  return WithCamera({GradeOf(*worst, kPixelSigmaPx), FindingCode("pixel_noise"), {{"pixel_sigma_px", *worst}}}, result,
                    static_cast<size_t>(worst - sigmas.begin()));
}

// Judges the influence of the captures on each camera.
std::vector<Finding> JudgeInfluence(const RunResult& result) {
  std::vector<Finding> findings;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    std::vector<NamedMove> moves;
    for (const ImageResult& image : result.images) {
      if (IsOf(result, image, c) && image.move_without) moves.push_back({image.capture, *image.move_without});
    }
    std::optional<Finding> finding = JudgeMoves(moves, DistanceOf(result, c));
    if (finding) findings.push_back(WithCamera(std::move(*finding), result, c));
  }
  return findings;
}

// Returns the index of the weak direction that is to be part of an uncertainty: that of the same camera, which contains
// the remedy of one that is not good; nothing if there is none.
std::optional<size_t> FindWeakDirection(const std::vector<Finding>& findings, const Finding& uncertainty) {
  if (uncertainty.grade == Grade::kGood) return std::nullopt;
  const auto weak = std::find_if(findings.begin(), findings.end(), [&](const Finding& finding) {
    return finding.code == FindingCode("weak_direction") && finding.Name("of_camera") == uncertainty.Name("of_camera");
  });
  return weak == findings.end() ? std::nullopt : std::optional(static_cast<size_t>(weak - findings.begin()));
}

// Judges the requirements, each for every camera that it concerns.
std::vector<Finding> JudgeRequirements(const RunResult& result) {
  std::vector<Finding> findings;
  for (const CameraRequirement& of_camera : result.requirements) {
    findings.push_back(
        WithCamera(JudgeRequirement(of_camera.requirement, result.errors[of_camera.camera].holdout_target_mm), result,
                   of_camera.camera));
  }
  return findings;
}

// Returns the observations without those that the figures of the result make needless: directions that are weak where a
// requirement says what is enough, and captures that contradict the others if the model explains captures that it has
// not seen.
std::vector<Finding> NeededObservations(const RunResult& result) {
  std::vector<Finding> findings = result.observations;
  const bool explains_unseen = result.holdout_chi2 && GradeOf(*result.holdout_chi2, kHeldOutChi2) == Grade::kGood;
  std::erase_if(findings, [&](const Finding& finding) {
    if (finding.code == FindingCode("captures_scatter")) return explains_unseen;
    if (finding.code != FindingCode("weak_direction")) return false;
    for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
      if (IsAbout(result, finding, c) && IsRequired(result, c)) return true;
    }
    return false;
  });
  return findings;
}

// Judges a result that has a refined estimate.
std::vector<Finding> JudgeCameras(const RunResult& result) {
  std::vector<Finding> findings = NeededObservations(result);
  const auto add = [&](std::vector<Finding> more) {
    for (Finding& finding : more) findings.push_back(std::move(finding));
  };
  add(JudgeRequirements(result));
  std::optional<Finding> uncertainty = JudgeUncertainty(result);
  const std::optional<size_t> weak = uncertainty ? FindWeakDirection(findings, *uncertainty) : std::nullopt;
  if (weak) {
    const auto part = findings.begin() + static_cast<std::ptrdiff_t>(*weak);
    uncertainty->numbers.insert(uncertainty->numbers.end(), part->numbers.begin(), part->numbers.end());
    uncertainty->parts.push_back(std::move(*part));
    findings.erase(part);
  }
  HoldOutFindings hold_out = JudgeHoldOut(result);
  add(std::move(hold_out.findings));
  if (std::optional<Finding> model = JudgeModel(result, hold_out.grade)) findings.push_back(std::move(*model));
  add(JudgeInfluence(result));
  if (uncertainty) findings.push_back(std::move(*uncertainty));
  // That there are few captures precedes what the few of them show.
  Finding images = JudgeImages(result);
  findings.insert(images.code == FindingCode("few_captures") ? findings.begin() : findings.end(), images);
  findings.push_back(JudgePixels(result));
  return findings;
}

// Compares in sigmas of all noise: if robot noise dominates, pixel errors say little about which estimate is better.
std::optional<Finding> JudgeGain(const RunResult& result) {
  const Estimate* const refined = FindRefined(result);
  if (refined == nullptr || !refined->errors.holdout_sigmas) return std::nullopt;
  const Estimate* const best = FindBestClosedForm(result, &HoldOutSigmas);
  if (best == nullptr) return std::nullopt;
  const double ratio = *best->errors.holdout_sigmas / *refined->errors.holdout_sigmas;
  constexpr double kUnlikely = 0.01;
  const bool is_better = ratio < kClosedFormBetter && best->errors.holdout_better_p.value_or(0) < kUnlikely;
  return Finding{is_better ? Grade::kDoubtful : Grade::kGood,
                 FindingCode("closed_form_better"),
                 {{"ratio", ratio}},
                 {{"method", best->method}, RobotNoiseName(result)}};
}

// Returns findings that tell a refinement that failed without the held-out captures from captures that were not held
// out.
std::vector<Finding> WithMissingHoldOutExplained(std::vector<Finding> findings, const RunResult& result) {
  const bool have_others = std::any_of(result.estimates.begin(), result.estimates.end(), [](const Estimate& estimate) {
    return estimate.errors.holdout_rms_px.has_value();
  });
  for (Finding& finding : findings) {
    if (have_others && finding.code == FindingCode("no_hold_out")) finding.names = {{"reason", "refinement_failed"}};
  }
  return findings;
}

// Judges a run on given poses of the target.
Finding JudgePoses(const Estimate* final_estimate) {
  if (final_estimate == nullptr || !final_estimate->errors.board_scatter) {
    return {Grade::kBad, FindingCode("no_estimate")};
  }
  constexpr Limits kScatterMm = {1.5, 5};
  constexpr Limits kScatterDeg = {0.3, 1};
  const BoardScatter& scatter = *final_estimate->errors.board_scatter;
  // The accuracy of the target's poses is unknown without images, so the grade is never better than doubtful.
  const Grade grade = std::max({Grade::kDoubtful, GradeOf(scatter.translation_rms_mm, kScatterMm),
                                GradeOf(scatter.rotation_rms_deg, kScatterDeg)});
  return {grade,
          FindingCode("poses_only"),
          {{"scatter_mm", scatter.translation_rms_mm}, {"scatter_deg", scatter.rotation_rms_deg}}};
}

Verdict VerdictOf(std::vector<Finding> findings) {
  findings = Sorted(WithSymptomsGathered(std::move(findings)));
  const Grade grade = findings.front().grade;
  return {grade, std::move(findings)};
}

}  // namespace

Verdict JudgeRun(const RunResult& result) {
  if (IsShort(result) && FindRefined(result) == nullptr) {
    std::vector<Finding> findings = result.observations;
    findings.push_back(JudgePoses(FindFinal(result)));
    findings.push_back(JudgeImages(result));
    return VerdictOf(std::move(findings));
  }
  std::vector<Finding> findings = WithMissingHoldOutExplained(JudgeCameras(result), result);
  if (std::optional<Finding> gain = JudgeGain(result)) findings.push_back(std::move(*gain));
  return VerdictOf(std::move(findings));
}

}  // namespace heba
