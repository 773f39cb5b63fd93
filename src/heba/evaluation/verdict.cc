#include "heba/evaluation/verdict.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "heba/base/units.h"
#include "heba/evaluation/judgement.h"
#include "heba/evaluation/limits.h"

namespace heba {
namespace {

// A closed form predicts held-out captures better than the refinement if the ratio of their errors is below this
// factor.
constexpr double kClosedFormBetter = 0.85;

// Returns the largest sigma among the unknowns of a group in a block.
double LargestSigma(const Covariance& covariance, std::string_view block_name, UnknownGroup group) {
  const UnknownBlock block = covariance.layout.Block(block_name);
  double largest = 0;
  for (Eigen::Index i = block.first; i < block.end(); ++i) {
    if (covariance.layout[i].group == group) largest = std::max(largest, covariance.matrix(i, i));
  }
  return std::sqrt(largest);
}

// Says how the noise of the robot was modelled, on which the remedy of a systematic error depends.
std::pair<std::string, std::string> RobotNoiseName(const PairSolution& solution) {
  return {"robot_noise", solution.robot_noise ? "modelled" : "none"};
}

// Returns the distance between camera and target.
double DistanceOf(const PairResult& result) {
  return std::max(kLeastDistanceM, result.working_point ? result.working_point->in_camera_m.norm() : kUsualDistanceM);
}

double ShareOfDistance(const PairResult& result, double mm) { return 1e-3 * mm / DistanceOf(result); }

double RobotErrorShareOf(const PairResult& result, const PairSolution& solution) {
  return RobotErrorShare(solution.robot_noise, solution.smooth_noise, DistanceOf(result));
}

int NumUsed(const PairResult& result) {
  return static_cast<int>(std::count_if(result.captures.begin(), result.captures.end(),
                                        [](const CaptureResult& capture) { return capture.used; }));
}

Finding JudgeUncertainty(const PairResult& result, const PairSolution& solution) {
  const double mm = 1000 * LargestSigma(solution.covariance, kHandEyeBlock, UnknownGroup::kTranslation);
  const double deg = RadToDeg(LargestSigma(solution.covariance, kHandEyeBlock, UnknownGroup::kRotation));
  Finding finding;
  finding.code = FindingCode("uncertainty");
  finding.numbers = {{"position_mm", mm}, {"orientation_deg", deg}};
  // A target is located by all unknowns together, whose errors partly cancel.
  double largest_mm = std::max(mm, 1000 * DistanceOf(result) * DegToRad(deg));
  if (result.working_point) {
    const double at_work_mm = 1000 * std::sqrt(result.working_point->covariance_m2.diagonal().maxCoeff());
    largest_mm = at_work_mm;
    finding.numbers.emplace_back("at_work_mm", at_work_mm);
    Finding& at_work = finding.parts.emplace_back(Finding{Grade::kGood, FindingCode("at_working_point")});
    at_work.numbers = {{"distance_mm", 1000 * result.working_point->in_camera_m.norm()}, {"at_work_mm", at_work_mm}};
  }
  finding.grade =
      GradeOfSigma(ShareOfDistance(result, largest_mm), RobotErrorShareOf(result, solution), NumUsed(result));
  if (solution.covariance.layout.Block(kCameraBlock).size == 0 && !solution.camera.params.empty()) {
    Finding& held = finding.parts.emplace_back(Finding{Grade::kGood, FindingCode("intrinsics_not_included")});
    if (result.working_point) {
      // A relative error of the focal length moves a target along its ray by the same relative amount.
      constexpr double kShare = 1e-3;
      held.numbers = {{"focal_error_percent", 100 * kShare},
                      {"moves_target_mm", 1000 * kShare * result.working_point->in_camera_m.norm()}};
    }
  }
  return finding;
}

Finding JudgeHoldOut(const PairResult& result, const PairSolution& solution, const Errors& errors) {
  const bool is_missing = !errors.holdout_target_mm || !errors.holdout_target_deg;
  const bool have_others = std::any_of(result.estimates.begin(), result.estimates.end(), [](const Estimate& estimate) {
    return estimate.errors.holdout_rms_px.has_value();
  });
  if (is_missing) {
    return {Grade::kDoubtful,
            FindingCode("no_hold_out"),
            {},
            {{"reason", have_others ? "refinement_failed" : "none_held_out"}}};
  }
  Finding finding;
  finding.code = FindingCode("hold_out");
  finding.grade = GradeOfHeldOut(ShareOfDistance(result, *errors.holdout_target_mm), *errors.holdout_target_deg,
                                 RobotErrorShareOf(result, solution));
  finding.numbers = {{"target_mm", *errors.holdout_target_mm}, {"target_deg", *errors.holdout_target_deg}};
  return finding;
}

// `of_hold_out`: the grade of the held-out errors.
std::optional<Finding> JudgeModel(const Errors& errors, const PairSolution& solution, Grade of_hold_out) {
  if (!errors.holdout_chi2) return std::nullopt;
  Finding finding;
  finding.code = FindingCode("unmodelled_error");
  finding.grade = GradeOfMisfit(*errors.holdout_chi2, of_hold_out);
  finding.numbers = {{"chi2_per_dof", *errors.holdout_chi2}};
  finding.names = {RobotNoiseName(solution)};
  return finding;
}

// Images without the target do not count as captures that were left out.
Finding JudgeCaptures(const PairResult& result) {
  const int num_used = NumUsed(result);
  const bool has_images = FindRefined(result) != nullptr;  // Given poses of the target are all seen.
  int num_seen = 0;
  int num_copies = 0;
  int num_listed = 0;
  for (const CaptureResult& capture : result.captures) {
    if (!capture.was_searched) continue;
    ++num_listed;
    const bool is_copy = !capture.repeat_of.empty();
    num_copies += is_copy ? 1 : 0;
    num_seen += !is_copy && (!has_images || capture.used || capture.num_points > 0) ? 1 : 0;
  }
  const int num_captures = num_listed - num_copies;
  const double left_out = num_seen > 0 ? 1 - static_cast<double>(num_used) / num_seen : 1;
  Finding finding;
  finding.code = num_used < kFewCaptures ? FindingCode("few_captures") : FindingCode("captures_left_out");
  finding.grade = std::max(GradeOf(left_out, kShareLeftOut), num_used < kFewCaptures ? Grade::kDoubtful : Grade::kGood);
  finding.numbers = {{"used", num_used}, {"seen", num_seen}, {"captures", num_captures}, {"copies", num_copies}};
  if (const Estimate* refined = FindRefined(result)) AddLeftOut(refined->errors.left_out_target_mm, &finding);
  return finding;
}

Finding JudgePixels(const PairSolution& solution) {
  return {GradeOf(solution.pixel_sigma_px, kPixelSigmaPx),
          FindingCode("pixel_noise"),
          {{"pixel_sigma_px", solution.pixel_sigma_px}}};
}

std::optional<Finding> JudgeInfluence(const PairResult& result) {
  std::vector<NamedMove> moves;
  for (const CaptureResult& capture : result.captures) {
    if (capture.move_without) moves.push_back({capture.image, *capture.move_without});
  }
  return JudgeMoves(moves, DistanceOf(result));
}

// Compares in sigmas of all noise: if robot noise dominates, pixel errors say little about which estimate is better.
std::optional<Finding> JudgeGain(const PairResult& result, const Estimate& refined) {
  if (!refined.errors.holdout_sigmas) return std::nullopt;
  const Estimate* best = FindBestClosedForm(result, &HoldOutSigmas);
  if (best == nullptr) return std::nullopt;
  const double ratio = *best->errors.holdout_sigmas / *refined.errors.holdout_sigmas;
  constexpr double kUnlikely = 0.01;
  const bool is_better = ratio < kClosedFormBetter && best->errors.holdout_better_p.value_or(0) < kUnlikely;
  return Finding{is_better ? Grade::kDoubtful : Grade::kGood,
                 FindingCode("closed_form_better"),
                 {{"ratio", ratio}},
                 {{"method", best->method}, RobotNoiseName(*refined.solution)}};
}

// Judges a run on given poses of the target.
Finding JudgePoses(const PairResult& result) {
  const Estimate* const final_estimate = FindFinal(result);
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

// Captures that contradict the others are no finding if the model explains captures that it has not seen.
void DropExplainedScatter(const std::optional<double>& holdout_chi2, std::vector<Finding>* findings) {
  if (!holdout_chi2 || GradeOf(*holdout_chi2, kHeldOutChi2) != Grade::kGood) return;
  std::erase_if(*findings, [](const Finding& finding) { return finding.code == FindingCode("captures_scatter"); });
}

}  // namespace

const Estimate* FindFinal(const PairResult& result) {
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

Verdict JudgeRun(const PairResult& result) {
  Verdict verdict;
  std::vector<Finding>& findings = verdict.findings;
  const Estimate* refined = FindRefined(result);
  findings = result.observations;
  if (refined == nullptr) {
    findings.push_back(JudgePoses(result));
    findings.push_back(JudgeCaptures(result));
  } else {
    const PairSolution& solution = *refined->solution;
    Finding uncertainty = JudgeUncertainty(result, solution);
    Finding hold_out = JudgeHoldOut(result, solution, refined->errors);
    const Grade of_hold_out = refined->errors.holdout_target_mm ? hold_out.grade : Grade::kGood;
    DropExplainedScatter(refined->errors.holdout_chi2, &findings);
    if (!result.requirements.empty()) {
      uncertainty.grade = Grade::kGood;
      if (refined->errors.holdout_target_mm) hold_out.grade = Grade::kGood;
      for (const Requirement& requirement : result.requirements) {
        findings.push_back(JudgeRequirement(requirement, refined->errors.holdout_target_mm));
      }
    }
    // A finding on poorly determined directions is part of the uncertainty and contains its remedy.
    const auto weak = std::find_if(findings.begin(), findings.end(), [](const Finding& finding) {
      return finding.code == FindingCode("weak_direction");
    });
    if (weak != findings.end()) {
      if (uncertainty.grade != Grade::kGood) {
        uncertainty.numbers.insert(uncertainty.numbers.end(), weak->numbers.begin(), weak->numbers.end());
        uncertainty.parts.push_back(std::move(*weak));
        findings.erase(weak);
      } else if (!result.requirements.empty()) {
        findings.erase(weak);
      }
    }
    findings.push_back(std::move(hold_out));
    const std::optional<Finding> more[] = {JudgeModel(refined->errors, solution, of_hold_out),
                                           JudgeGain(result, *refined), JudgeInfluence(result)};
    for (const std::optional<Finding>& finding : more) {
      if (finding) findings.push_back(*finding);
    }
    findings.push_back(std::move(uncertainty));
    // That there are few captures precedes what the few of them show.
    Finding captures = JudgeCaptures(result);
    findings.insert(captures.code == FindingCode("few_captures") ? findings.begin() : findings.end(), captures);
    findings.push_back(JudgePixels(solution));
  }
  GatherSymptoms(&findings);
  SortFindings(&findings);
  verdict.grade = findings.front().grade;
  return verdict;
}

}  // namespace heba
