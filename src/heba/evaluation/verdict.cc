#include "heba/evaluation/verdict.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

// A figure up to `doubtful` is graded good, up to `bad` doubtful, and above it bad.
struct Limits {
  double doubtful;
  double bad;
};

// The limits suit usual cells. A requirement in the config replaces the first five.
constexpr Limits kPositionMm = {1, 5};
constexpr Limits kOrientationDeg = {0.1, 0.5};
constexpr Limits kAtWorkMm = {1, 5};
constexpr Limits kHeldOutMm = {1.5, 5};
constexpr Limits kHeldOutDeg = {0.3, 1};
constexpr Limits kHeldOutChi2 = {1.5, 3};  // Per degree of freedom; 1 if the model is right.
constexpr Limits kPixelSigmaPx = {1, 5};
constexpr Limits kShareLeftOut = {0.25, 0.6};  // Share of the captures that show the target.
constexpr int kFewCaptures = 8;
// A closed form predicts held-out captures better than the refinement if the ratio of their errors is below this
// factor.
constexpr double kClosedFormBetter = 0.85;

Grade GradeOf(double value, const Limits& limits) {
  if (!(value <= limits.bad)) return Grade::kBad;
  return value <= limits.doubtful ? Grade::kGood : Grade::kDoubtful;
}

// Returns the largest sigma among the unknowns of a group in a block.
double LargestSigma(const Covariance& covariance, std::string_view block_name, UnknownGroup group) {
  const UnknownBlock block = covariance.layout.Block(block_name);
  double largest = 0;
  for (Eigen::Index i = block.first; i < block.end(); ++i) {
    if (covariance.layout[i].group == group) largest = std::max(largest, covariance.matrix(i, i));
  }
  return std::sqrt(largest);
}

Finding JudgeUncertainty(const RunResult& result, const Solution& solution) {
  const double mm = 1000 * LargestSigma(solution.covariance, kHandEyeBlock, UnknownGroup::kTranslation);
  const double deg = RadToDeg(LargestSigma(solution.covariance, kHandEyeBlock, UnknownGroup::kRotation));
  Finding finding;
  finding.code = "uncertainty";
  finding.grade = std::max(GradeOf(mm, kPositionMm), GradeOf(deg, kOrientationDeg));
  finding.text = "the camera's pose is known to " + ShownAmount(mm, 2) + " mm and " + ShownAmount(deg, 2) +
                 " deg (one sigma, along and about the least certain axis)";
  finding.numbers = {{"position_mm", mm}, {"orientation_deg", deg}};
  if (result.working_point) {
    const double at_work_mm = 1000 * std::sqrt(result.working_point->covariance_m2.diagonal().maxCoeff());
    finding.grade = std::max(finding.grade, GradeOf(at_work_mm, kAtWorkMm));
    finding.text += "; a target seen " + Significant(1000 * result.working_point->in_camera_m.norm(), 3) +
                    " mm away is located to " + ShownAmount(at_work_mm, 2) + " mm";
    finding.numbers.emplace_back("at_work_mm", at_work_mm);
  }
  if (solution.covariance.layout.Block(kCameraBlock).size == 0 && !solution.camera.params.empty()) {
    finding.text += "; the intrinsics were held, and their error is not part of these figures";
    if (result.working_point) {
      // A relative error of the focal length moves a target along its ray by the same relative amount.
      constexpr double kShare = 1e-3;
      finding.text += " (an error of 0.1 % in the focal length moves that target by " +
                      Significant(1000 * kShare * result.working_point->in_camera_m.norm(), 2) + " mm)";
    }
  }
  if (finding.grade != Grade::kGood) {
    finding.action =
        "take more captures, with larger rotations of the gripper about different axes and a larger range of distances";
  }
  return finding;
}

// Judges each requirement; the requirements replace the built-in limits.
std::vector<Finding> JudgeRequirements(const RunResult& result, const Errors& errors) {
  std::vector<Finding> findings;
  for (const Requirement& requirement : result.requirements) {
    const double within_mm = 1000 * requirement.within_m;
    const double reached_mm = 1000 * requirement.reached_m;
    const double held_out_mm = errors.holdout_target_mm.value_or(0);
    Finding finding;
    finding.code = "required";
    finding.grade = reached_mm <= within_mm && held_out_mm <= within_mm ? Grade::kGood : Grade::kBad;
    finding.text = "a target located at " + requirement.place + " has an error of up to " + ShownAmount(reached_mm, 2) +
                   " mm with a confidence of " + Significant(100 * requirement.confidence, 3) + " %; " +
                   Significant(within_mm, 3) + " mm are required";
    if (errors.holdout_target_mm) {
      finding.text += ", and on held-out captures the target is off by " + ShownAmount(held_out_mm, 2) + " mm (RMS)";
    }
    finding.numbers = {{"required_mm", within_mm}, {"reached_mm", reached_mm}, {"held_out_mm", held_out_mm}};
    if (finding.grade != Grade::kGood) {
      finding.action = reached_mm > within_mm
                           ? "take more captures, with larger rotations of the gripper and a larger range of distances"
                           : "check the captures with the largest errors; calibrate the robot";
    }
    findings.push_back(std::move(finding));
  }
  return findings;
}

Finding JudgeHoldOut(const RunResult& result, const Errors& errors) {
  const bool is_missing = !errors.holdout_target_mm || !errors.holdout_target_deg;
  const bool have_others = std::any_of(result.estimates.begin(), result.estimates.end(), [](const Estimate& estimate) {
    return estimate.errors.holdout_rms_px.has_value();
  });
  if (is_missing && have_others) {
    return {Grade::kDoubtful, "no_hold_out",
            "the refinement failed without the held-out captures: the hold-out error is not known",
            "take more captures: too few are left to determine the camera and its pose when some are held out"};
  }
  if (is_missing) {
    return {Grade::kDoubtful, "no_hold_out", "no captures were held out: the hold-out error is not known",
            "set evaluate.folds to 5"};
  }
  Finding finding;
  finding.code = "hold_out";
  finding.grade =
      std::max(GradeOf(*errors.holdout_target_mm, kHeldOutMm), GradeOf(*errors.holdout_target_deg, kHeldOutDeg));
  finding.text = "on held-out captures the target is off by " + ShownAmount(*errors.holdout_target_mm, 2) + " mm and " +
                 ShownAmount(*errors.holdout_target_deg, 2) + " deg from its predicted pose (RMS)";
  finding.numbers = {{"target_mm", *errors.holdout_target_mm}, {"target_deg", *errors.holdout_target_deg}};
  if (finding.grade != Grade::kGood) {
    finding.action =
        "check the captures with the largest residuals; let the robot settle before each image; check the "
        "robot's own calibration, the pose format and the target's dimensions";
  }
  return finding;
}

std::optional<Finding> JudgeModel(const Errors& errors, const Solution& solution) {
  if (!errors.holdout_chi2) return std::nullopt;
  Finding finding;
  finding.code = "unmodelled_error";
  finding.grade = GradeOf(*errors.holdout_chi2, kHeldOutChi2);
  finding.text = "the held-out captures scatter " + Significant(std::sqrt(*errors.holdout_chi2), 2) +
                 " times as much as the assumed noise explains";
  finding.numbers = {{"chi2_per_dof", *errors.holdout_chi2}};
  if (finding.grade != Grade::kGood) {
    finding.action = solution.robot_noise
                         ? "the error is neither pixel noise nor white robot noise: check the target's dimensions, the "
                           "camera model and the captures with the largest corrections"
                         : "the robot is not exact: use refine.robot_noise: auto";
  }
  return finding;
}

// Images without the target do not count as captures that were left out.
Finding JudgeCaptures(const RunResult& result) {
  int num_used = 0;
  int num_seen = 0;
  int num_copies = 0;
  int num_listed = 0;
  for (const CaptureResult& capture : result.captures) {
    if (!capture.was_searched) continue;
    ++num_listed;
    const bool is_copy = !capture.repeat_of.empty();
    num_copies += is_copy ? 1 : 0;
    num_used += capture.used ? 1 : 0;
    num_seen += !is_copy && (capture.used || capture.num_points > 0) ? 1 : 0;
  }
  const int num_captures = num_listed - num_copies;
  const double left_out = num_seen > 0 ? 1 - static_cast<double>(num_used) / num_seen : 1;
  Finding finding;
  finding.code = num_used < kFewCaptures ? "few_captures" : "captures_left_out";
  finding.grade = std::max(GradeOf(left_out, kShareLeftOut), num_used < kFewCaptures ? Grade::kDoubtful : Grade::kGood);
  finding.text =
      std::to_string(num_used) + " of " + std::to_string(num_seen) + " captures that show the target were used";
  if (num_seen < num_captures) {
    finding.text += "; " + std::to_string(num_captures - num_seen) + " images show no target";
  }
  if (num_copies > 0) finding.text += " (" + std::to_string(num_copies) + " are copies of others)";
  finding.numbers = {{"used", num_used}, {"seen", num_seen}, {"captures", num_captures}, {"copies", num_copies}};
  if (num_used < kFewCaptures) {
    finding.action = "take 15 to 25 captures";
  } else if (finding.grade != Grade::kGood) {
    finding.action = "see the reasons in the table of captures";
  }
  return finding;
}

Finding JudgePixels(const Solution& solution) {
  Finding finding;
  finding.code = "pixel_noise";
  finding.grade = GradeOf(solution.pixel_sigma_px, kPixelSigmaPx);
  finding.text = "the pixel noise is " + Significant(solution.pixel_sigma_px, 2) + " px per coordinate (one sigma)";
  finding.numbers = {{"pixel_sigma_px", solution.pixel_sigma_px}};
  if (finding.grade != Grade::kGood) {
    finding.action =
        "good images give 0.02 to 0.3 px: check focus, motion blur, the camera model and the robot's poses";
  }
  return finding;
}

// Reports a capture with more influence than chance explains, where the probability is multiplied by the number of
// captures that were tested. If many captures are improbable, the assumed noise is wrong rather than the captures;
// JudgeModel judges the noise.
std::optional<Finding> JudgeInfluence(const RunResult& result) {
  constexpr double kUnlikely = 0.01;
  const CaptureResult* strongest = nullptr;
  int num_asked = 0;
  int num_unlikely = 0;
  for (const CaptureResult& capture : result.captures) {
    if (!capture.move_without) continue;
    ++num_asked;
    num_unlikely += capture.move_without->chance < kUnlikely ? 1 : 0;
    if (strongest == nullptr || capture.move_without->chance < strongest->move_without->chance) strongest = &capture;
  }
  constexpr double kFew = 0.2;
  if (strongest == nullptr || num_unlikely > std::max(1.0, kFew * num_asked)) return std::nullopt;
  constexpr double kMattersM = 0.3e-3;
  constexpr double kMattersRad = 5e-4;
  const double move_m = strongest->move_without->tangent.head<3>().norm();
  const double move_rad = strongest->move_without->tangent.tail<3>().norm();
  const double chance = std::min(1.0, num_asked * strongest->move_without->chance);
  if (chance > kUnlikely || (move_m < kMattersM && move_rad < kMattersRad)) return std::nullopt;
  return Finding{Grade::kDoubtful,
                 "influential_capture",
                 "without " + strongest->image + " the camera pose would move by " + ShownAmount(1000 * move_m, 2) +
                     " mm and " + ShownAmount(RadToDeg(move_rad), 2) +
                     " deg, more than the assumed noise explains (probability " + ShownChance(chance) + ")",
                 "check this image and its robot pose; leave the capture out if one of them is wrong",
                 {{"move_mm", 1000 * move_m}, {"move_deg", RadToDeg(move_rad)}, {"chance", chance}}};
}

// Compares in sigmas of all noise: if robot noise dominates, pixel errors say little about which estimate is better.
std::optional<Finding> JudgeGain(const RunResult& result, const Estimate& refined) {
  if (!refined.errors.holdout_sigmas) return std::nullopt;
  const Estimate* best = FindBestClosedForm(result, &HoldOutSigmas);
  if (best == nullptr) return std::nullopt;
  const double ratio = *best->errors.holdout_sigmas / *refined.errors.holdout_sigmas;
  Finding finding;
  finding.code = "closed_form_better";
  finding.grade = ratio < kClosedFormBetter ? Grade::kDoubtful : Grade::kGood;
  finding.text = "the best closed form (" + best->method + ") predicts held-out captures " +
                 (ratio >= 1 ? Significant(ratio, 2) + " times worse" : Significant(1 / ratio, 2) + " times better") +
                 ", in sigmas of pixel and robot noise";
  finding.numbers = {{"ratio", ratio}};
  if (finding.grade != Grade::kGood) {
    finding.action = "the residuals contain a systematic error that the model does not describe: ";
    finding.action += refined.solution->robot_noise ? "free fewer groups of refine.intrinsics, or give a camera file"
                                                    : "use refine.robot_noise: auto";
  }
  return finding;
}

// Judges a run on given poses of the target.
Finding JudgePoses(const RunResult& result) {
  const auto chain = std::find_if(result.estimates.begin(), result.estimates.end(), [](const Estimate& estimate) {
    return estimate.ok && estimate.kind == EstimateKind::kRefined;
  });
  if (chain == result.estimates.end() || !chain->errors.board_scatter) {
    return {Grade::kBad, "no_estimate", "there is no refined estimate", "see the reasons of the methods"};
  }
  constexpr Limits kScatterMm = {1.5, 5};
  constexpr Limits kScatterDeg = {0.3, 1};
  const BoardScatter& scatter = *chain->errors.board_scatter;
  // The accuracy of the target's poses is unknown without images, so the grade is never better than doubtful.
  const Grade grade = std::max({Grade::kDoubtful, GradeOf(scatter.translation_rms_mm, kScatterMm),
                                GradeOf(scatter.rotation_rms_deg, kScatterDeg)});
  return {grade,
          "poses_only",
          "only poses of the target were given, no images: they scatter by " +
              ShownAmount(scatter.translation_rms_mm, 2) + " mm and " + ShownAmount(scatter.rotation_rms_deg, 2) +
              " deg in the frame where the target is fixed",
          "give the images or the corners: a refinement from them is more accurate and reports its uncertainty",
          {{"scatter_mm", scatter.translation_rms_mm}, {"scatter_deg", scatter.rotation_rms_deg}}};
}

// Returns whether a finding shows that something is wrong, without its cause.
bool IsSymptom(const Finding& finding) {
  constexpr std::array<std::string_view, 9> kSymptoms = {
      "hold_out",    "unmodelled_error",    "closed_form_better", "captures_left_out", "captures_scatter",
      "pixel_noise", "influential_capture", "uncertainty",        "required"};
  return std::find(kSymptoms.begin(), kSymptoms.end(), finding.code) != kSymptoms.end();
}

// If a cause makes the result bad, its consequences are reported in the same finding: the first bad symptom is appended
// to its text, and all symptoms that are not good are removed.
void GatherUnderCause(std::vector<Finding>* findings) {
  const auto cause = std::find_if(findings->begin(), findings->end(), [](const Finding& finding) {
    return finding.is_cause && finding.grade == Grade::kBad;
  });
  if (cause == findings->end()) return;
  for (const Finding& finding : *findings) {
    if (finding.grade != Grade::kBad || !IsSymptom(finding)) continue;
    cause->text += "; as a consequence, " + finding.text;
    cause->numbers.insert(cause->numbers.end(), finding.numbers.begin(), finding.numbers.end());
    break;
  }
  findings->erase(std::remove_if(findings->begin(), findings->end(),
                                 [](const Finding& finding) {
                                   return !finding.is_cause && finding.grade != Grade::kGood && IsSymptom(finding);
                                 }),
                  findings->end());
}

}  // namespace

std::string_view GradeName(Grade grade) {
  constexpr std::string_view kNames[] = {"good", "doubtful", "bad"};
  return kNames[static_cast<size_t>(grade)];
}

Verdict JudgeRun(const RunResult& result) {
  Verdict verdict;
  std::vector<Finding>& findings = verdict.findings;
  const Estimate* refined = FindRefined(result);
  findings = result.observations;
  if (refined == nullptr) {
    findings.push_back(JudgePoses(result));
  } else {
    const Solution& solution = *refined->solution;
    Finding uncertainty = JudgeUncertainty(result, solution);
    Finding hold_out = JudgeHoldOut(result, refined->errors);
    if (!result.requirements.empty()) {
      uncertainty.grade = Grade::kGood;
      uncertainty.action.clear();
      if (refined->errors.holdout_target_mm) {
        hold_out.grade = Grade::kGood;
        hold_out.action.clear();
      }
      for (Finding& finding : JudgeRequirements(result, refined->errors)) findings.push_back(std::move(finding));
    }
    // A finding on poorly determined directions is part of the uncertainty and contains its remedy.
    const auto weak = std::find_if(findings.begin(), findings.end(),
                                   [](const Finding& finding) { return finding.code == "weak_direction"; });
    if (weak != findings.end()) {
      if (uncertainty.grade != Grade::kGood) {
        uncertainty.text += "; " + weak->text;
        if (!weak->action.empty()) uncertainty.action = weak->action;
        uncertainty.numbers.insert(uncertainty.numbers.end(), weak->numbers.begin(), weak->numbers.end());
        findings.erase(weak);
      } else if (!result.requirements.empty()) {
        findings.erase(weak);
      }
    }
    findings.push_back(std::move(hold_out));
    const std::optional<Finding> more[] = {JudgeModel(refined->errors, solution), JudgeGain(result, *refined),
                                           JudgeInfluence(result)};
    for (const std::optional<Finding>& finding : more) {
      if (finding) findings.push_back(*finding);
    }
    findings.push_back(std::move(uncertainty));
    findings.push_back(JudgeCaptures(result));
    findings.push_back(JudgePixels(solution));
  }
  GatherUnderCause(&findings);
  std::stable_sort(findings.begin(), findings.end(), [](const Finding& a, const Finding& b) {
    return a.grade != b.grade ? a.grade > b.grade : a.is_cause && !b.is_cause;
  });
  verdict.grade = findings.front().grade;
  return verdict;
}

}  // namespace heba
