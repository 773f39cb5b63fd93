#include "tools/pages/comparison.h"

#include <algorithm>
#include <functional>
#include <map>

#include <nlohmann/json.hpp>

#include "heba/base/median.h"
#include "heba/base/text.h"
#include "tools/pages/page.h"
#include "tools/pages/static_chart.h"
#include "tools/text/difference_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

UncertainPose HandEyeOf(const Estimate& refined) {
  const Covariance& covariance = refined.solution->covariance;
  return {refined.hand_eye.camera_mount_from_camera, covariance.matrix.topLeftCorner<6, 6>(),
          refined.solution->covariance_dof};
}

// Returns nothing unless both runs have the same setup and a refined pose with a covariance.
std::optional<PairDifference> PairOf(const std::vector<ComparedRun>& runs, size_t first, size_t second) {
  const RunResult& a = runs[first].result;
  const RunResult& b = runs[second].result;
  const Estimate* refined_a = FindRefined(a);
  const Estimate* refined_b = FindRefined(b);
  if (a.setup != b.setup || refined_a == nullptr || refined_b == nullptr) return std::nullopt;
  const std::optional<PoseDifference> difference = DifferenceOf(HandEyeOf(*refined_a), HandEyeOf(*refined_b));
  if (!difference) return std::nullopt;
  return PairDifference{*difference, first, second};
}

// Compares the error of the refinement with the best closed form of each run. The best closed form is selected by its
// hold-out error, so the selection itself has seen the held-out captures.
std::string GainFinding(const std::vector<ComparedRun>& runs, const std::string& what, FigureOf choice,
                        FigureOf figure) {
  std::vector<double> ratios;
  for (const ComparedRun& run : runs) {
    const Estimate* refined = FindRefined(run.result);
    if (refined == nullptr || !figure(refined->errors)) continue;
    const Estimate* closed = FindBestClosedForm(run.result, choice);
    if (closed != nullptr && figure(closed->errors)) {
      ratios.push_back(*figure(closed->errors) / *figure(refined->errors));
    }
  }
  if (ratios.empty()) return "";
  const auto num_better = std::count_if(ratios.begin(), ratios.end(), [](double ratio) { return ratio > 1; });
  const auto [least, most] = std::minmax_element(ratios.begin(), ratios.end());
  return what + ": the refinement is better than the best closed form in " + std::to_string(num_better) + " of " +
         std::to_string(ratios.size()) + " runs; the closed form's error is " + Significant(Median(ratios), 2) +
         " times the refinement's (median; " + Significant(*least, 2) + " to " + Significant(*most, 2) + ")";
}

std::optional<double> TrueMm(const Errors& errors) {
  return errors.truth ? std::optional<double>(errors.truth->hand_eye_mm) : std::nullopt;
}
std::optional<double> TrueDeg(const Errors& errors) {
  return errors.truth ? std::optional<double>(errors.truth->hand_eye_deg) : std::nullopt;
}

// Words the agreement of the pairs that `concerns` selects.
std::string AgreementOfPairs(const Comparison& comparison, const std::string& what,
                             const std::function<bool(const PairDifference&)>& concerns) {
  std::vector<NamedDifference> differences;
  for (const PairDifference& pair : comparison.pairs) {
    if (!concerns(pair)) continue;
    differences.push_back({comparison.runs[pair.first].label + " and " + comparison.runs[pair.second].label, pair});
  }
  return AgreementFinding(what, differences);
}

std::vector<std::string> FindingsOf(const Comparison& comparison) {
  std::vector<std::string> findings;
  const std::string gain_px = GainFinding(comparison.runs, "hold-out error in px", &HoldOutPx, &HoldOutPx);
  const std::string gain_mm =
      GainFinding(comparison.runs, "hold-out error at the target in mm", &HoldOutMm, &HoldOutMm);
  const bool is_robot_noisy = std::any_of(comparison.runs.begin(), comparison.runs.end(), [](const ComparedRun& run) {
    const Estimate* refined = FindRefined(run.result);
    return refined != nullptr && refined->solution->robot_noise.has_value();
  });
  for (const std::string& gain : {gain_px, gain_mm}) {
    if (!gain.empty()) findings.push_back(gain);
  }
  if (findings.empty()) findings.emplace_back("no run has hold-out figures for comparing methods (evaluate.folds)");
  if (is_robot_noisy) {
    findings.emplace_back(
        "if robot noise is modelled, it contributes to the hold-out error of every method: the true "
        "gain is larger than these figures (see the hold-out chi-square and sigma)");
  }
  const std::string true_mm = GainFinding(
      comparison.runs, "true error in mm of the closed form with the smallest hold-out RMS", &HoldOutPx, &TrueMm);
  const std::string true_deg =
      GainFinding(comparison.runs, "true error in deg of the same closed form", &HoldOutPx, &TrueDeg);
  for (const std::string& gain : {true_mm, true_deg}) {
    if (!gain.empty()) findings.push_back(gain);
  }
  const auto target_of = [&](size_t run) { return comparison.runs[run].result.target_type; };
  const std::string same =
      AgreementOfPairs(comparison, "hand-eye poses from targets of one type",
                       [&](const PairDifference& pair) { return target_of(pair.first) == target_of(pair.second); });
  const std::string across =
      AgreementOfPairs(comparison, "hand-eye poses from targets of different types",
                       [&](const PairDifference& pair) { return target_of(pair.first) != target_of(pair.second); });
  for (const std::string& finding : {across, same}) {
    if (!finding.empty()) findings.push_back(finding);
  }
  // The sigma of the hand-eye translation shows the value of each type of target.
  std::map<std::string, std::vector<double>> sigmas;
  for (const ComparedRun& run : comparison.runs) {
    const Estimate* refined = FindRefined(run.result);
    const std::optional<double> sigma = refined == nullptr ? std::nullopt : TranslationSigmaMm(*refined);
    if (sigma) sigmas[run.result.target_type].push_back(*sigma);
  }
  if (sigmas.size() > 1) {
    std::vector<std::string> parts;
    for (const auto& [type, values] : sigmas) parts.push_back(type + " " + Significant(Median(values), 2) + " mm");
    findings.push_back("one sigma of the hand-eye translation by target (median): " + Join(parts, ", "));
  }
  return findings;
}

std::string Exact(const std::optional<double>& value) { return value ? RoundTrip(*value) : std::string(); }

// The figures of one run that the table, the CSV file and the page show.
struct RunLine {
  std::string closed_form;
  std::optional<double> closed_px;
  std::optional<double> refined_px;
  std::optional<double> sigma_mm;
  std::optional<double> sigma_deg;
  std::optional<double> board_mm;
  std::optional<double> board_deg;
};

RunLine LineOf(const RunResult& result) {
  RunLine line;
  if (const Estimate* closed = FindBestClosedForm(result, &HoldOutPx)) {
    line.closed_form = closed->method;
    line.closed_px = closed->errors.holdout_rms_px;
  }
  if (const Estimate* refined = FindRefined(result)) {
    line.refined_px = refined->errors.holdout_rms_px;
    line.sigma_mm = TranslationSigmaMm(*refined);
    line.sigma_deg = RotationSigmaDeg(*refined);
    if (refined->errors.board_scatter) {
      line.board_mm = refined->errors.board_scatter->translation_rms_mm;
      line.board_deg = refined->errors.board_scatter->rotation_rms_deg;
    }
  }
  return line;
}

}  // namespace

Comparison CompareRuns(std::vector<ComparedRun> runs) {
  Comparison comparison;
  comparison.runs = std::move(runs);
  for (size_t first = 0; first < comparison.runs.size(); ++first) {
    for (size_t second = first + 1; second < comparison.runs.size(); ++second) {
      const std::optional<PairDifference> pair = PairOf(comparison.runs, first, second);
      if (pair) comparison.pairs.push_back(*pair);
    }
  }
  comparison.findings = FindingsOf(comparison);
  return comparison;
}

std::string ComparisonTable(const Comparison& comparison) {
  constexpr size_t kNameWidth = 20;
  const auto shortened = [](const std::string& label) { return ShortenedAtStart(label, kNameWidth); };
  std::string table = PadRight("run", kNameWidth) + PadRight(" target", 15) + PadLeft("hold-out px", 19) +
                      PadLeft("sigma", 9) + PadLeft("board", 9) + PadLeft("time", 8) + "\n" +
                      PadRight("", kNameWidth + 15) + PadLeft("closed", 10) + PadLeft("refined", 9) + PadLeft("mm", 9) +
                      PadLeft("mm rms", 9) + PadLeft("s", 8) + "\n";
  for (const ComparedRun& run : comparison.runs) {
    const RunLine line = LineOf(run.result);
    table += PadRight(shortened(run.label), kNameWidth) + PadRight(" " + run.result.target_type, 15) +
             PadLeft(FigureText(line.closed_px), 10) + PadLeft(FigureText(line.refined_px), 9) +
             PadLeft(FigureText(line.sigma_mm), 9) + PadLeft(FigureText(line.board_mm), 9) +
             PadLeft(Significant(run.result.timing.total_s, 2), 8) + "\n";
  }
  // The least likely pairs come first; the page and the CSV file list all of them.
  std::vector<PairDifference> pairs = comparison.pairs;
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const PairDifference& a, const PairDifference& b) { return a.p_value < b.p_value; });
  constexpr size_t kMaxPairs = 10;
  if (!pairs.empty()) {
    table += "\n" + PadRight("hand-eye difference", 2 * kNameWidth + 2) + PadLeft("mm", 9) + PadLeft("deg", 9) +
             PadLeft("chance", 10) + "\n";
  }
  for (size_t i = 0; i < std::min(pairs.size(), kMaxPairs); ++i) {
    table += PadRight(shortened(comparison.runs[pairs[i].first].label), kNameWidth + 1) + " " +
             PadRight(shortened(comparison.runs[pairs[i].second].label), kNameWidth) +
             PadLeft(Significant(pairs[i].distance_mm, 2), 9) + PadLeft(Significant(pairs[i].angle_deg, 2), 9) +
             PadLeft(ShownPValue(pairs[i].p_value), 10) + "  " + Agreement(pairs[i]) + "\n";
  }
  if (pairs.size() > kMaxPairs) table += "and " + std::to_string(pairs.size() - kMaxPairs) + " more pairs\n";
  table += "\nsigma is that of the whole position: the root of the sum of the variances of the three axes\n";
  for (const std::string& finding : comparison.findings) table += "- " + finding + "\n";
  return table;
}

std::string ComparisonRunsCsv(const Comparison& comparison) {
  std::string csv =
      "run,setup,target,closed_form,closed_form_holdout_px,refined_holdout_px,std_translation_mm,std_rotation_deg,"
      "board_translation_rms_mm,board_rotation_rms_deg,seconds\n";
  for (const ComparedRun& run : comparison.runs) {
    const RunLine line = LineOf(run.result);
    csv += CsvField(run.label) + "," + std::string(SetupName(run.result.setup)) + "," + run.result.target_type + "," +
           line.closed_form + "," + Exact(line.closed_px) + "," + Exact(line.refined_px) + "," + Exact(line.sigma_mm) +
           "," + Exact(line.sigma_deg) + "," + Exact(line.board_mm) + "," + Exact(line.board_deg) + "," +
           RoundTrip(run.result.timing.total_s) + "\n";
  }
  return csv;
}

std::string ComparisonPairsCsv(const Comparison& comparison) {
  std::string csv = "first,second,distance_mm,angle_deg,std_mm,std_deg,p_value,verdict\n";
  for (const PairDifference& pair : comparison.pairs) {
    csv += CsvField(comparison.runs[pair.first].label) + "," + CsvField(comparison.runs[pair.second].label) + "," +
           RoundTrip(pair.distance_mm) + "," + RoundTrip(pair.angle_deg) + "," + RoundTrip(pair.sigma_mm) + "," +
           RoundTrip(pair.sigma_deg) + "," + RoundTrip(pair.p_value) + "," + Agreement(pair) + "\n";
  }
  return csv;
}

std::string ComparisonPage(const Comparison& comparison) {
  std::string body = "<h1>Comparison of " + std::to_string(comparison.runs.size()) + " runs</h1>\n<ul>\n";
  for (const std::string& finding : comparison.findings)
    body += "<li>" + EscapedForMarkup(Capitalised(finding)) + "</li>\n";
  body += "</ul>\n" + Heading("Runs");
  using Json = nlohmann::ordered_json;
  Json bars = Json::array();
  Json labels = Json::array();
  std::vector<FigureRow> charted;
  std::vector<std::vector<PageCell>> rows;
  for (const ComparedRun& run : comparison.runs) {
    const RunLine line = LineOf(run.result);
    labels.push_back(run.label);
    charted.push_back({run.label, line.refined_px, line.closed_px});
    bars.push_back(Json{{"label", run.label}, {"values", {OrNull(line.refined_px), OrNull(line.closed_px)}}});
    rows.push_back({{run.label},
                    {std::string(GradeName(run.result.verdict.grade))},
                    {std::string(SetupName(run.result.setup))},
                    {run.result.target_type},
                    {line.closed_form},
                    {FigureText(line.closed_px), true},
                    {FigureText(line.refined_px), true},
                    {FigureText(line.sigma_mm), true},
                    {FigureText(line.sigma_deg), true},
                    {FigureText(line.board_mm), true},
                    {FigureText(line.board_deg), true},
                    {Significant(run.result.timing.total_s, 3), true}});
  }
  body += ViewFigure("dumbbells", "RMS reprojection error on held-out captures.",
                     Json{{"unit", "px"}, {"series", {"refined", "best closed form"}}, {"rows", bars}},
                     DumbbellChart("RMS in px: refined (first colour), best closed form (second)", charted));
  body += Paragraph(
      "Sigma is that of the whole hand-eye position or orientation: the root of the sum of the variances of the three "
      "axes.");
  body += HtmlTable({"run", "verdict", "setup", "target", "best closed form", "closed form hold-out, px",
                     "refined hold-out, px", "sigma, mm", "sigma, deg", "board, mm", "board, deg", "time, s"},
                    rows);
  rows.clear();
  Json pairs = Json::array();
  for (const PairDifference& pair : comparison.pairs) {
    pairs.push_back(Json{{"first", pair.first},
                         {"second", pair.second},
                         {"mm", pair.distance_mm},
                         {"deg", pair.angle_deg},
                         {"sigma_mm", pair.sigma_mm},
                         {"sigma_deg", pair.sigma_deg},
                         {"chance", pair.p_value}});
    rows.push_back({{comparison.runs[pair.first].label},
                    {comparison.runs[pair.second].label},
                    {Significant(pair.distance_mm, 3), true},
                    {Significant(pair.sigma_mm, 3), true},
                    {Significant(pair.angle_deg, 3), true},
                    {Significant(pair.sigma_deg, 3), true},
                    {ShownPValue(pair.p_value), true},
                    {Agreement(pair)}});
  }
  body += Heading("Differences between hand-eye poses");
  if (!comparison.pairs.empty()) {
    body += ViewFigure("pairs", "Distance between the camera positions of the runs, mm.",
                       Json{{"runs", labels}, {"pairs", pairs}});
  }
  body += Paragraph(
      "The chance is the probability of a difference at least as large between runs that measure the same pose and "
      "share no captures; "
      "below "
      "1 % the poses are said to differ.");
  const std::string table = HtmlTable({"run", "other run", "mm", "sigma, mm", "deg", "sigma, deg", "chance", ""}, rows);
  constexpr size_t kManyPairs = 30;
  body += rows.size() <= kManyPairs
              ? table
              : "<details><summary>All " + std::to_string(rows.size()) + " pairs</summary>\n" + table + "</details>\n";
  return HtmlPage("Comparison of runs", body, PageWidth::kWide);
}

}  // namespace heba
