#include "heba/evaluation/verdict.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

Grade GradeOf(double value, double doubtful, double bad) {
  if (!(value <= bad)) return Grade::kBad;
  return value <= doubtful ? Grade::kGood : Grade::kDoubtful;
}

// The largest of three sigmas.
double LargestSigma(const Covariance& covariance, Eigen::Index first) {
  return std::sqrt(covariance.matrix.diagonal().segment<3>(first).maxCoeff());
}

Finding JudgeUncertainty(const RunResult& result, const Solution& solution) {
  const double mm = 1000 * LargestSigma(solution.covariance, 0);
  const double deg = RadToDeg(LargestSigma(solution.covariance, 3));
  Finding finding;
  finding.grade = std::max(GradeOf(mm, 1, 5), GradeOf(deg, 0.1, 0.5));
  finding.what = "the camera's pose is known to " + Significant(mm, 2) + " mm and " + Significant(deg, 2) +
                 " deg (one sigma, along and about the axis that is known worst)";
  if (result.working_point) {
    const double at_work_mm = 1000 * std::sqrt(result.working_point->covariance_m2.diagonal().maxCoeff());
    finding.grade = std::max(finding.grade, GradeOf(at_work_mm, 1, 5));
    finding.what += "; a target seen " + Significant(1000 * result.working_point->in_camera_m.norm(), 3) +
                    " mm away to " + Significant(at_work_mm, 2) + " mm";
  }
  if (finding.grade != Grade::kGood) {
    finding.cure = "take more captures, with larger turns of the gripper about different axes and more depth";
  }
  return finding;
}

std::optional<Finding> JudgeHoldOut(const Errors& errors) {
  if (!errors.holdout_target_mm || !errors.holdout_target_deg) {
    return Finding{Grade::kDoubtful, "nothing was held out: how well unseen captures are predicted is not known",
                   "set evaluate.folds to 5"};
  }
  Finding finding;
  finding.grade = std::max(GradeOf(*errors.holdout_target_mm, 1.5, 5), GradeOf(*errors.holdout_target_deg, 0.3, 1));
  finding.what = "on captures that it has not seen the target was " + Significant(*errors.holdout_target_mm, 2) +
                 " mm and " + Significant(*errors.holdout_target_deg, 2) + " deg from where it was predicted (rms)";
  if (finding.grade != Grade::kGood) {
    finding.cure =
        "look at the captures with the largest residuals; let the robot settle before each picture; check its own "
        "calibration, the pose format and the board's measures";
  }
  return finding;
}

std::optional<Finding> JudgeModel(const Errors& errors, const Solution& solution) {
  if (!errors.holdout_chi2) return std::nullopt;
  Finding finding;
  finding.grade = GradeOf(*errors.holdout_chi2, 1.5, 3);
  finding.what = "unseen captures scatter " + Significant(std::sqrt(*errors.holdout_chi2), 2) +
                 " times as much as the noise that is assumed allows";
  if (finding.grade != Grade::kGood) {
    finding.cure = solution.robot_noise
                       ? "something is wrong that is neither pixel noise nor the robot's: the board's measures, the "
                         "camera model, wrong captures"
                       : "the robot is not exact: use refine.robot_noise: auto";
  }
  return finding;
}

Finding JudgeCaptures(const RunResult& result) {
  const auto num_used = std::count_if(result.captures.begin(), result.captures.end(),
                                      [](const CaptureResult& capture) { return capture.used; });
  const auto num_copies = std::count_if(result.captures.begin(), result.captures.end(),
                                        [](const CaptureResult& capture) { return !capture.repeat_of.empty(); });
  const double total = static_cast<double>(result.captures.size()) - static_cast<double>(num_copies);
  const double unused = total > 0 ? 1 - static_cast<double>(num_used) / total : 1;
  Finding finding;
  finding.grade = std::max(GradeOf(unused, 0.25, 0.6), num_used < 8 ? Grade::kDoubtful : Grade::kGood);
  finding.what = std::to_string(num_used) + " of " + std::to_string(result.captures.size()) + " captures were used" +
                 (num_copies == 0 ? "" : " (" + std::to_string(num_copies) + " are copies of others)");
  if (num_used < 8) {
    finding.cure = "take 15 to 25 captures";
  } else if (finding.grade != Grade::kGood) {
    finding.cure = "see the reasons in the table of captures";
  }
  return finding;
}

Finding JudgePixels(const Solution& solution) {
  Finding finding;
  finding.grade = GradeOf(solution.pixel_sigma_px, 1, 5);
  finding.what = "the points are off by " + Significant(solution.pixel_sigma_px, 2) + " px a coordinate (one sigma)";
  if (finding.grade != Grade::kGood) {
    finding.cure =
        "good pictures give 0.02 to 0.3 px: check focus, motion blur, the camera model and the robot's poses";
  }
  return finding;
}

// One capture that pulls harder than chance would have it, though all of them were asked. Where many do, not they are
// wrong but the noise that is assumed, which is judged by itself.
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
                 "without " + strongest->image + " the camera would be " + Significant(1000 * move_m, 2) + " mm and " +
                     Significant(RadToDeg(move_rad), 2) +
                     " deg elsewhere, more than the noise that is assumed explains (chance " + Significant(chance, 1) +
                     ")",
                 "look at that picture and at the robot's pose for it; leave it out if one of them is wrong"};
}

std::optional<Finding> JudgeGain(const RunResult& result, const Estimate& refined) {
  if (!refined.errors.holdout_target_mm) return std::nullopt;
  const Estimate* best = FindBestClosedForm(result, &HoldOutMm);
  if (best == nullptr) return std::nullopt;
  const double ratio = *best->errors.holdout_target_mm / *refined.errors.holdout_target_mm;
  Finding finding;
  constexpr double kWorse = 0.85;
  finding.grade = ratio < kWorse ? Grade::kDoubtful : Grade::kGood;
  finding.what = "the best closed form (" + best->method + ") predicts unseen captures " +
                 (ratio >= 1 ? Significant(ratio, 2) + " times worse" : Significant(1 / ratio, 2) + " times better") +
                 ", in mm at the target";
  if (finding.grade != Grade::kGood) {
    finding.cure =
        "the refinement bends to something that its model does not know; try refine.robot_noise: auto or fewer "
        "refine.intrinsics";
  }
  return finding;
}

// A run on poses that others found of the target.
Finding JudgePoses(const RunResult& result) {
  const auto chain = std::find_if(result.estimates.begin(), result.estimates.end(),
                                  [](const Estimate& estimate) { return estimate.ok && estimate.kind == "refined"; });
  if (chain == result.estimates.end() || !chain->errors.board_scatter) {
    return {Grade::kBad, "there is no refined estimate", "see the methods' reasons"};
  }
  const BoardScatter& scatter = *chain->errors.board_scatter;
  // Without pictures nobody knows how good the poses of the target are: never better than doubtful.
  const Grade grade = std::max(
      {Grade::kDoubtful, GradeOf(scatter.translation_rms_mm, 1.5, 5), GradeOf(scatter.rotation_rms_deg, 0.3, 1)});
  return {grade,
          "poses of the target were given, not pictures: it scatters by " + Significant(scatter.translation_rms_mm, 2) +
              " mm and " + Significant(scatter.rotation_rms_deg, 2) + " deg where it should stand still",
          "give the pictures or the corners: what is refined from them is better, and says how good it is"};
}

}  // namespace

std::string_view GradeName(Grade grade) {
  constexpr std::string_view kNames[] = {"good", "doubtful", "bad"};
  return kNames[static_cast<size_t>(grade)];
}

Verdict JudgeRun(const RunResult& result) {
  Verdict verdict;
  const Estimate* refined = FindRefined(result);
  if (refined == nullptr) {
    verdict.findings.push_back(JudgePoses(result));
  } else {
    const Solution& solution = *refined->solution;
    const std::optional<Finding> more[] = {JudgeHoldOut(refined->errors), JudgeModel(refined->errors, solution),
                                           JudgeGain(result, *refined)};
    for (const std::optional<Finding>& finding : more) {
      if (finding) verdict.findings.push_back(*finding);
    }
    // What was predicted is judged first; then what may be behind it. A remark ends with its own cure.
    for (const std::string& remark : solution.remarks) verdict.findings.push_back({Grade::kDoubtful, remark, ""});
    if (const std::optional<Finding> finding = JudgeInfluence(result)) verdict.findings.push_back(*finding);
    verdict.findings.push_back(JudgeUncertainty(result, solution));
    verdict.findings.push_back(JudgeCaptures(result));
    verdict.findings.push_back(JudgePixels(solution));
  }
  std::stable_sort(verdict.findings.begin(), verdict.findings.end(),
                   [](const Finding& a, const Finding& b) { return a.grade > b.grade; });
  verdict.grade = verdict.findings.front().grade;
  return verdict;
}

}  // namespace heba
