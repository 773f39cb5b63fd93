#include "tools/pages/comparison.h"

#include <algorithm>
#include <functional>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "heba/base/error.h"
#include "heba/base/median.h"
#include "heba/base/text.h"
#include "heba/data/hand_eye.h"
#include "tools/pages/page.h"
#include "tools/text/difference_text.h"
#include "tools/text/figure_columns.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

using CameraFigure = std::optional<double> CameraFigures::*;

// Returns a pose of a run; nothing if it has none of this name. The pose of camera a in b is that of b in a, inverted.
std::optional<UncertainPose> FindPose(const ComparedRun& run, const ComparedPoseName& name) {
  for (const ComparedPose& pose : run.poses) {
    if (pose.name == name) return pose.parent_from_child;
    if (name.kind != ComparedPoseKind::kCameraInCamera) continue;
    if (!(pose.name == ComparedPoseName{name.kind, name.child, name.parent})) continue;
    const UncertainPose& inverse = pose.parent_from_child;
    const Eigen::Matrix<double, 6, 6> adjoint = Adjoint(inverse.pose);
    return UncertainPose{Inverse(inverse.pose), adjoint * inverse.covariance * adjoint.transpose(),
                         inverse.covariance_dof};
  }
  return std::nullopt;
}

std::vector<RunDifference> DifferencesOf(const std::vector<ComparedRun>& runs, size_t first, size_t second) {
  std::vector<RunDifference> differences;
  for (const ComparedPose& pose : runs[first].poses) {
    const std::optional<UncertainPose> other = FindPose(runs[second], pose.name);
    if (!other) continue;
    const std::optional<PoseDifference> difference = DifferenceOf(pose.parent_from_child, *other);
    if (difference) differences.push_back({*difference, first, second, pose.name});
  }
  return differences;
}

// Returns a run of one camera, which is compared with rigs, whose camera has the name of the run.
ComparedRun WithNamedCamera(ComparedRun run) {
  if (run.poses.empty()) throw InputError(run.label + ": has no refined estimate, which is compared with rigs");
  run.cameras.front().name = run.name;
  run.poses.front().name.child = run.name;
  return run;
}

std::string LabelsOf(const Comparison& comparison, const RunDifference& difference) {
  return comparison.runs[difference.first].label + " and " + comparison.runs[difference.second].label;
}

// Throws InputError if the runs, one of which is a rig, cannot be compared.
void CheckRuns(const Comparison& comparison) {
  const auto several = std::find_if(comparison.runs.begin(), comparison.runs.end(),
                                    [](const ComparedRun& run) { return run.arms.size() > 1; });
  for (const ComparedRun& run : comparison.runs) {
    if (several == comparison.runs.end() || run.arms.front() == several->arms.front()) continue;
    throw InputError(run.label + ": its world is the base of " +
                     (run.arms.front().empty() ? "an arm without a name" : "arm " + run.arms.front()) +
                     ", but that of " + several->label + " is the base of arm " + several->arms.front() +
                     "; runs are compared that name the same arm first");
  }
  if (comparison.runs.size() < 2) return;
  std::vector<const ComparedRun*> without;
  for (size_t i = 0; i < comparison.runs.size(); ++i) {
    const bool is_compared =
        std::any_of(comparison.differences.begin(), comparison.differences.end(),
                    [&](const RunDifference& difference) { return difference.first == i || difference.second == i; });
    if (!is_compared) without.push_back(&comparison.runs[i]);
  }
  // The run of one camera is named first, because it may have left a rig without another run.
  for (const ComparedRun* run : without) {
    if (!run->methods) continue;
    throw InputError(run->label + ": is the run of one camera; a rig beside it needs a " +
                     run->poses.front().name.Text() + ", which it is compared with");
  }
  if (without.empty()) return;
  throw InputError(without.front()->label +
                   ": has no camera, target or arm of the same name and mount as one of another run, by which rigs are "
                   "compared");
}

// Compares the error of the refinement with that of a closed form of each run. The best closed form is selected by its
// hold-out error, so the selection itself has seen the held-out captures.
std::string GainFinding(const std::vector<ComparedRun>& runs, const std::string& what,
                        CameraFigures ComparedMethods::*closed_form, CameraFigure figure) {
  std::vector<double> ratios;
  for (const ComparedRun& run : runs) {
    if (!run.methods) continue;
    const std::optional<double> closed = run.methods.value().*closed_form.*figure;
    const std::optional<double> refined = run.cameras.front().figures.*figure;
    if (closed && refined) ratios.push_back(*closed / *refined);
  }
  if (ratios.empty()) return "";
  const auto num_better = std::count_if(ratios.begin(), ratios.end(), [](double ratio) { return ratio > 1; });
  const auto [least, most] = std::minmax_element(ratios.begin(), ratios.end());
  return what + ": the refinement is better than the best closed form in " + std::to_string(num_better) + " of " +
         std::to_string(ratios.size()) + " runs; the closed form's error is " + Significant(Median(ratios), 2) +
         " times the refinement's (median; " + Significant(*least, 2) + " to " + Significant(*most, 2) + ")";
}

// Returns findings about the methods; none if no run has any.
std::vector<std::string> MethodFindings(const std::vector<ComparedRun>& runs) {
  const auto has_methods = [](const ComparedRun& run) { return run.methods.has_value(); };
  if (std::none_of(runs.begin(), runs.end(), has_methods)) return {};
  std::vector<std::string> findings = {
      GainFinding(runs, "hold-out error in px", &ComparedMethods::best_px, &CameraFigures::holdout_rms_px),
      GainFinding(runs, "hold-out error at the target in mm", &ComparedMethods::best_mm,
                  &CameraFigures::holdout_target_mm)};
  std::erase(findings, "");
  if (findings.empty()) findings.emplace_back("no run has hold-out figures for comparing methods (evaluate.folds)");
  if (std::any_of(runs.begin(), runs.end(),
                  [](const ComparedRun& run) { return run.methods && run.methods->has_robot_noise; })) {
    findings.emplace_back(
        "if robot noise is modelled, it contributes to the hold-out error of every method: the true "
        "gain is larger than these figures (see the hold-out chi-square and sigma)");
  }
  findings.push_back(GainFinding(runs, "true error in mm of the closed form with the smallest hold-out RMS",
                                 &ComparedMethods::best_px, &CameraFigures::truth_mm));
  findings.push_back(GainFinding(runs, "true error in deg of the same closed form", &ComparedMethods::best_px,
                                 &CameraFigures::truth_deg));
  return findings;
}

// Words the agreement of the poses of each kind or, if all runs are those of one camera, for targets of different types
// and of one type.
std::vector<std::string> AgreementFindings(const Comparison& comparison) {
  const auto is_kind = [](ComparedPoseKind kind) {
    return [kind](const RunDifference& difference) { return difference.name.kind == kind; };
  };
  const auto is_one_type = [&](const RunDifference& difference) {
    return comparison.runs[difference.first].target_types == comparison.runs[difference.second].target_types;
  };
  using Groups = std::vector<std::pair<const char*, std::function<bool(const RunDifference&)>>>;
  const Groups groups = comparison.has_rig
                            ? Groups{{"poses of cameras", is_kind(ComparedPoseKind::kCamera)},
                                     {"poses between cameras", is_kind(ComparedPoseKind::kCameraInCamera)},
                                     {"poses of targets", is_kind(ComparedPoseKind::kTarget)},
                                     {"poses of arms", is_kind(ComparedPoseKind::kArm)}}
                            : Groups{{"hand-eye poses from targets of different types", std::not_fn(is_one_type)},
                                     {"hand-eye poses from targets of one type", is_one_type}};
  std::vector<std::string> findings;
  for (const auto& [what, is_of_group] : groups) {
    std::vector<NamedDifference> differences;
    for (const RunDifference& difference : comparison.differences) {
      if (!is_of_group(difference)) continue;
      differences.push_back(
          {(comparison.has_rig ? difference.name.Text() + ": " : "") + LabelsOf(comparison, difference), difference});
    }
    findings.push_back(AgreementFinding(what, differences));
  }
  return findings;
}

// Names the cameras, targets and arms that some rigs lack.
std::string MissingFinding(const std::vector<ComparedRun>& runs) {
  std::vector<std::string> parts;
  std::vector<ComparedPoseName> known;
  for (const ComparedRun& run : runs) {
    for (const ComparedPose& pose : run.poses) {
      // A pose between cameras is missing because one of the cameras is.
      if (pose.name.kind == ComparedPoseKind::kCameraInCamera) continue;
      if (std::find(known.begin(), known.end(), pose.name) != known.end()) continue;
      known.push_back(pose.name);
      std::vector<std::string> without;
      for (const ComparedRun& other : runs) {
        if (!other.methods && !FindPose(other, pose.name)) without.push_back(other.label);
      }
      if (!without.empty()) parts.push_back(pose.name.Text() + " (not in " + Join(without, ", ") + ")");
    }
  }
  return parts.empty() ? "" : "not in all rigs: " + Join(parts, ", ");
}

// States the sigma of the hand-eye translation for each type of target, which shows the value of the type; empty if
// there is one type.
std::string SigmaFinding(const std::vector<ComparedRun>& runs) {
  std::map<std::string, std::vector<double>> sigmas;
  for (const ComparedRun& run : runs) {
    const std::optional<double> sigma = run.cameras.front().figures.sigma_mm;
    if (sigma) sigmas[run.target_types].push_back(*sigma);
  }
  if (sigmas.size() < 2) return "";
  std::vector<std::string> parts;
  for (const auto& [type, values] : sigmas) parts.push_back(type + " " + Significant(Median(values), 2) + " mm");
  return "one sigma of the hand-eye translation by target (median): " + Join(parts, ", ");
}

std::vector<std::string> FindingsOf(const Comparison& comparison) {
  std::vector<std::string> findings = MethodFindings(comparison.runs);
  const std::vector<std::string> agreements = AgreementFindings(comparison);
  findings.insert(comparison.has_rig ? findings.begin() : findings.end(), agreements.begin(), agreements.end());
  findings.push_back(comparison.has_rig ? MissingFinding(comparison.runs) : SigmaFinding(comparison.runs));
  std::erase(findings, "");
  return findings;
}

// A camera of a run: a row of the tables.
struct RunRow {
  const ComparedRun& run;
  const ComparedCamera& camera;
};

std::vector<RunRow> RowsOf(const Comparison& comparison) {
  std::vector<RunRow> rows;
  for (const ComparedRun& run : comparison.runs) {
    for (const ComparedCamera& camera : run.cameras) rows.push_back({run, camera});
  }
  return rows;
}

std::optional<double> ClosedPx(const RunRow& row) {
  return row.run.methods ? row.run.methods->best_px.holdout_rms_px : std::nullopt;
}

std::function<std::optional<double>(const RunRow&)> Of(CameraFigure figure) {
  return [figure](const RunRow& row) { return row.camera.figures.*figure; };
}

// A column of compare.csv and of the page's table.
struct RunColumn {
  // Its names in compare.csv if all runs are those of one camera, and if there is a rig; null: it is not in the file.
  const char* name;
  const char* name_of_rig;
  const char* title;  // On the page, which leaves out a column without values.
  std::variant<std::function<std::string(const RunRow&)>, std::function<std::optional<double>(const RunRow&)>> value;
};

std::vector<RunColumn> RunColumns() {
  using Text = std::function<std::string(const RunRow&)>;
  using Figure = std::function<std::optional<double>(const RunRow&)>;
  return {
      {"run", "run", "run", Text([](const RunRow& row) { return row.run.label; })},
      {nullptr, "camera", "camera", Text([](const RunRow& row) { return row.camera.name; })},
      {nullptr, "verdict", "verdict of the run",
       Text([](const RunRow& row) { return std::string(GradeName(row.run.grade)); })},
      {"setup", nullptr, "setup or mount", Text([](const RunRow& row) { return row.camera.setup; })},
      {"target", nullptr, "target", Text([](const RunRow& row) { return row.run.target_types; })},
      {"closed_form", nullptr, "best closed form",
       Text([](const RunRow& row) { return row.run.methods ? row.run.methods->closed_form : ""; })},
      {"closed_form_holdout_px", nullptr, "closed form hold-out, px", Figure(&ClosedPx)},
      {nullptr, "reprojection_rms_px", "in-sample, px", Of(&CameraFigures::reprojection_rms_px)},
      {"refined_holdout_px", "holdout_rms_px", "hold-out, px", Of(&CameraFigures::holdout_rms_px)},
      {nullptr, "holdout_target_mm", "hold-out, mm", Of(&CameraFigures::holdout_target_mm)},
      {nullptr, "holdout_target_deg", "hold-out, deg", Of(&CameraFigures::holdout_target_deg)},
      {"std_translation_mm", "std_translation_mm", "sigma, mm", Of(&CameraFigures::sigma_mm)},
      {"std_rotation_deg", "std_rotation_deg", "sigma, deg", Of(&CameraFigures::sigma_deg)},
      {"board_translation_rms_mm", nullptr, "board, mm", Of(&CameraFigures::board_mm)},
      {"board_rotation_rms_deg", nullptr, "board, deg", Of(&CameraFigures::board_deg)},
      {"seconds", "seconds", "time of the run, s", Figure([](const RunRow& row) { return row.run.seconds; })},
  };
}

// Formats the value of a row: a text, or a figure as `of_figure` does.
std::string ValueText(const RunColumn& column, const RunRow& row, std::string (*of_text)(const std::string&),
                      std::string (*of_figure)(const std::optional<double>&)) {
  if (const auto* text = std::get_if<0>(&column.value)) return of_text((*text)(row));
  return of_figure(std::get<1>(column.value)(row));
}

std::string Exact(const std::optional<double>& value) { return value ? RoundTrip(*value) : std::string(); }
std::string Same(const std::string& text) { return text; }

constexpr size_t kRunWidth = 20;
constexpr size_t kSecondWidth = 15;  // The width of the names of cameras, or of types of targets.

std::string RunsTable(const Comparison& comparison) {
  using Columns = std::vector<FigureColumn<RunRow>>;
  const Columns columns = comparison.has_rig
                              ? Columns{{"in-sample", "px rms", 10, 3, Of(&CameraFigures::reprojection_rms_px)},
                                        {"hold-out", "px rms", 9, 3, Of(&CameraFigures::holdout_rms_px)},
                                        {"hold-out", "mm rms", 9, 3, Of(&CameraFigures::holdout_target_mm)},
                                        {"sigma", "mm", 8, 3, Of(&CameraFigures::sigma_mm)},
                                        {"sigma", "deg", 8, 3, Of(&CameraFigures::sigma_deg)}}
                              : Columns{{"", "closed", 9, 3, &ClosedPx},
                                        {"hold-out px", "refined", 9, 3, Of(&CameraFigures::holdout_rms_px)},
                                        {"sigma", "mm", 9, 3, Of(&CameraFigures::sigma_mm)},
                                        {"board", "mm rms", 9, 3, Of(&CameraFigures::board_mm)},
                                        {"time", "s", 8, 2, [](const RunRow& row) { return row.run.seconds; }}};
  const auto names = [](const std::string& run, const std::string& second) {
    return PadRight(ShortenedAtStart(run, kRunWidth), kRunWidth) + " " +
           PadRight(ShortenedAtStart(second, kSecondWidth), kSecondWidth);
  };
  std::string table = ColumnHeads(names("run", comparison.has_rig ? "camera" : "target"), names("", ""), columns);
  for (const RunRow& row : RowsOf(comparison)) {
    table += names(row.run.label, comparison.has_rig ? row.camera.name : row.run.target_types) +
             FigureCells(columns, row) + "\n";
  }
  return table;
}

// Returns a table of the differences of each pair of runs, the pair with the least likely difference first. Runs of one
// camera have one difference, which is a line.
std::string DifferencesTable(const Comparison& comparison) {
  constexpr size_t kMostPairsOfRigs = 3;
  constexpr size_t kMostPairs = 10;
  constexpr size_t kNameWidth = 36;
  constexpr size_t kLabelWidth = kNameWidth / 2 - 1;
  const std::vector<FigureColumn<RunDifference>> columns = {{"mm", "", 8, 2, &RunDifference::distance_mm},
                                                            {"sigma", "", 7, 2, &RunDifference::sigma_mm},
                                                            {"deg", "", 8, 2, &RunDifference::angle_deg},
                                                            {"sigma", "", 7, 2, &RunDifference::sigma_deg}};
  const auto head = [&](const std::string& title) {
    std::string line = ColumnHeads(PadRight(title, kNameWidth), "", columns);
    return line.insert(line.size() - 1, PadLeft("chance", 7));
  };
  std::map<std::pair<size_t, size_t>, std::vector<const RunDifference*>> of_pairs;
  for (const RunDifference& difference : comparison.differences) {
    of_pairs[{difference.first, difference.second}].push_back(&difference);
  }
  std::vector<std::pair<double, std::vector<const RunDifference*>>> pairs;
  for (const auto& [pair, differences] : of_pairs) {
    double least_p_value = 1;
    for (const RunDifference* difference : differences) least_p_value = std::min(least_p_value, difference->p_value);
    pairs.emplace_back(least_p_value, differences);
  }
  std::stable_sort(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  const bool has_rig = comparison.has_rig;
  const size_t num_shown = std::min(pairs.size(), has_rig ? kMostPairsOfRigs : kMostPairs);
  std::string table = has_rig || pairs.empty() ? "" : "\n" + head("hand-eye difference");
  for (size_t i = 0; i < num_shown; ++i) {
    const std::vector<const RunDifference*>& differences = pairs[i].second;
    if (has_rig) table += "\n" + LabelsOf(comparison, *differences.front()) + "\n" + head("  difference");
    for (const RunDifference* difference : differences) {
      const auto label = [&](size_t run) {
        return PadRight(ShortenedAtStart(comparison.runs[run].label, kLabelWidth), kLabelWidth + 1);
      };
      table += (has_rig ? PadRight("  " + ShortenedAtStart(difference->name.Text(), kNameWidth - 2), kNameWidth)
                        : label(difference->first) + label(difference->second)) +
               FigureCells(columns, *difference) + PadLeft(ShownPValue(difference->p_value), 7) + " " +
               Agreement(*difference) + "\n";
    }
  }
  if (pairs.size() > num_shown) {
    table += "and " + std::to_string(pairs.size() - num_shown) + " more pairs" + (has_rig ? " of runs\n" : "\n");
  }
  return table;
}

std::string RunsPart(const Comparison& comparison) {
  using Json = nlohmann::ordered_json;
  const std::vector<RunRow> rows = RowsOf(comparison);
  Json bars = Json::array();
  for (const RunRow& row : rows) {
    const CameraFigures& figures = row.camera.figures;
    bars.push_back(Json{
        {"label", row.run.label + (comparison.has_rig ? ", " + row.camera.name : "")},
        {"values",
         {OrNull(figures.holdout_rms_px), OrNull(comparison.has_rig ? figures.reprojection_rms_px : ClosedPx(row))}}});
  }
  const auto chart = [&](const char* caption, const char* first, const char* second) {
    return ViewFigure("dumbbells", caption, Json{{"unit", "px"}, {"series", {first, second}}, {"rows", bars}});
  };
  std::vector<std::string> head;
  std::vector<std::vector<PageCell>> cells(rows.size());
  for (const RunColumn& column : RunColumns()) {
    const bool is_figure = column.value.index() == 1;
    std::vector<std::string> texts;
    for (const RunRow& row : rows) texts.push_back(ValueText(column, row, &Same, &FigureText));
    const std::string missing = is_figure ? FigureText(std::nullopt) : "";
    if (std::all_of(texts.begin(), texts.end(), [&](const std::string& text) { return text == missing; })) continue;
    head.emplace_back(column.title);
    for (size_t i = 0; i < rows.size(); ++i) cells[i].push_back({texts[i], is_figure});
  }
  return Heading(comparison.has_rig ? "Cameras" : "Runs") +
         (comparison.has_rig
              ? chart("RMS reprojection error of each camera, with the poses of the arm as it reports them.",
                      "held-out captures", "captures of the estimate")
              : chart("RMS reprojection error on held-out captures.", "refined", "best closed form")) +
         Paragraph(
             "Sigma is that of the whole position or orientation of the camera: the root of the sum of the variances "
             "of "
             "the three axes. That of a single axis, which heba run states, is smaller.") +
         HtmlTable(head, cells);
}

std::string DifferencesPart(const Comparison& comparison) {
  using Json = nlohmann::ordered_json;
  Json labels = Json::array();
  for (const ComparedRun& run : comparison.runs) labels.push_back(run.label);
  Json pairs = Json::array();
  std::vector<std::vector<PageCell>> rows;
  for (const RunDifference& difference : comparison.differences) {
    pairs.push_back(Json{{"first", difference.first},
                         {"second", difference.second},
                         {"mm", difference.distance_mm},
                         {"deg", difference.angle_deg},
                         {"sigma_mm", difference.sigma_mm},
                         {"sigma_deg", difference.sigma_deg},
                         {"chance", difference.p_value}});
    std::vector<PageCell>& row = rows.emplace_back();
    if (comparison.has_rig) row.push_back({difference.name.Text()});
    row.insert(row.end(), {{comparison.runs[difference.first].label},
                           {comparison.runs[difference.second].label},
                           {Significant(difference.distance_mm, 3), true},
                           {Significant(difference.sigma_mm, 3), true},
                           {Significant(difference.angle_deg, 3), true},
                           {Significant(difference.sigma_deg, 3), true},
                           {ShownPValue(difference.p_value), true},
                           {Agreement(difference)}});
  }
  std::vector<std::string> head = {"run", "other run", "mm", "sigma, mm", "deg", "sigma, deg", "chance", ""};
  if (comparison.has_rig) head.insert(head.begin(), "pose");
  const std::string table = HtmlTable(head, rows);
  constexpr size_t kManyRows = 30;
  const std::string figure = comparison.has_rig || rows.empty()
                                 ? ""
                                 : ViewFigure("pairs", "Distance between the camera positions of the runs, mm.",
                                              Json{{"runs", labels}, {"pairs", pairs}});
  return Heading(comparison.has_rig ? "Differences between poses" : "Differences between hand-eye poses") + figure +
         Paragraph(
             "Sigma is that of the difference, from both runs, of the whole position or orientation: the root of the "
             "sum of the variances of the three axes. The chance is the probability of a difference at least as large "
             "between runs that measure the same pose and share no captures; below 1 % the poses are said to differ.") +
         (rows.size() <= kManyRows ? table : Details("All " + std::to_string(rows.size()) + " differences", table));
}

}  // namespace

std::string ComparedPoseName::Text() const {
  switch (kind) {
    case ComparedPoseKind::kCamera:
      return "camera " + child + " in " + parent;
    case ComparedPoseKind::kCameraInCamera:
      return "camera " + child + " in camera " + parent;
    case ComparedPoseKind::kTarget:
      return "target " + child + " in " + parent;
    case ComparedPoseKind::kArm:
      break;
  }
  return "base of arm " + child + " in " + parent;
}

namespace {

// Returns the solution with its repeatable covariance, if it has one: two runs of a cell have the same scales, which
// make no difference between them.
Solution WithoutWhatIsShared(Solution solution) {
  if (solution.covariance_repeatable.matrix.size() > 0) solution.covariance = solution.covariance_repeatable;
  return solution;
}

// Returns the poses of a run.
std::vector<ComparedPose> PosesOf(const RunResult& result) {
  std::vector<ComparedPose> all;
  const Solution session = WithoutWhatIsShared(result.solution);
  const std::pair<ComparedPoseKind, std::vector<RelativePose>> groups[] = {
      {ComparedPoseKind::kCamera, CameraPoses(result.rig, session)},
      {ComparedPoseKind::kCameraInCamera, RelativeCameraPoses(result.rig, session)},
      {ComparedPoseKind::kTarget, TargetPoses(result.rig, session)},
      {ComparedPoseKind::kArm, BasePoses(result.rig, session)}};
  for (const auto& [kind, poses] : groups) {
    for (const RelativePose& pose : poses) {
      all.push_back(
          {{kind, pose.parent, pose.child}, {pose.parent_from_child, pose.covariance, result.solution.covariance_dof}});
    }
  }
  return all;
}

// Returns the run with its only camera, without a name, and its methods.
ComparedRun WithMethods(ComparedRun run, const RunResult& result) {
  const Estimate* const refined = FindRefined(result);
  if (refined != nullptr) {
    run.poses = PosesOf(result);
    // Its target has no name either: that of another run may be another one.
    std::erase_if(run.poses, [](const ComparedPose& pose) { return pose.name.kind != ComparedPoseKind::kCamera; });
  }
  run.cameras = {{"", std::string(SetupName(SetupOf(result.rig.cameras[0].mount))), FiguresOf(refined)}};
  const Estimate* const best_px = FindBestClosedForm(result, &HoldOutPx);
  run.methods = {best_px == nullptr ? "" : best_px->method, FiguresOf(best_px),
                 FiguresOf(FindBestClosedForm(result, &HoldOutMm)),
                 refined != nullptr && refined->solution->robot_noise.has_value()};
  return run;
}

}  // namespace

ComparedRun ComparedRunOf(const std::string& label, const RunResult& result) {
  ComparedRun run{label,
                  result.name,
                  result.verdict.grade,
                  result.timing.total_s,
                  Join(result.target_types, " "),
                  result.rig.robots};
  if (IsShort(result)) return WithMethods(std::move(run), result);
  const std::vector<RelativePose> cameras = CameraPoses(result.rig, result.solution);
  for (size_t c = 0; c < cameras.size(); ++c) {
    run.cameras.push_back({cameras[c].child, MountText(result.rig, result.rig.cameras[c]),
                           WithSigmas(FiguresOf(result, c), cameras[c].covariance)});
  }
  run.poses = PosesOf(result);
  return run;
}

Comparison CompareRuns(std::vector<ComparedRun> runs) {
  Comparison comparison;
  comparison.runs = std::move(runs);
  comparison.has_rig =
      std::any_of(comparison.runs.begin(), comparison.runs.end(), [](const ComparedRun& run) { return !run.methods; });
  for (ComparedRun& run : comparison.runs) {
    if (comparison.has_rig && run.methods) run = WithNamedCamera(std::move(run));
  }
  for (size_t first = 0; first < comparison.runs.size(); ++first) {
    for (size_t second = first + 1; second < comparison.runs.size(); ++second) {
      for (RunDifference& difference : DifferencesOf(comparison.runs, first, second)) {
        comparison.differences.push_back(std::move(difference));
      }
    }
  }
  if (comparison.has_rig) CheckRuns(comparison);
  comparison.findings = FindingsOf(comparison);
  return comparison;
}

std::string ComparisonTable(const Comparison& comparison) {
  std::string table = RunsTable(comparison) + DifferencesTable(comparison) + "\n" +
                      "sigma is that of the whole position or orientation: the root of the sum of the variances of the "
                      "three axes\n";
  for (const std::string& finding : comparison.findings) table += "- " + finding + "\n";
  return table;
}

std::string ComparisonRunsCsv(const Comparison& comparison) {
  std::vector<RunColumn> columns = RunColumns();
  const auto name_of = [&](const RunColumn& column) { return comparison.has_rig ? column.name_of_rig : column.name; };
  std::erase_if(columns, [&](const RunColumn& column) { return name_of(column) == nullptr; });
  std::vector<std::string> fields;
  for (const RunColumn& column : columns) fields.emplace_back(name_of(column));
  std::string csv = Join(fields, ",") + "\n";
  for (const RunRow& row : RowsOf(comparison)) {
    fields.clear();
    for (const RunColumn& column : columns) fields.push_back(ValueText(column, row, &CsvField, &Exact));
    csv += Join(fields, ",") + "\n";
  }
  return csv;
}

std::string ComparisonPairsCsv(const Comparison& comparison) {
  std::string csv = std::string("first,second,") + (comparison.has_rig ? "kind,parent,child," : "") +
                    "distance_mm,angle_deg,std_mm,std_deg,p_value,verdict\n";
  for (const RunDifference& difference : comparison.differences) {
    csv += CsvField(comparison.runs[difference.first].label) + "," +
           CsvField(comparison.runs[difference.second].label) + ",";
    if (comparison.has_rig) {
      csv += std::string(kComparedPoseKindNames[static_cast<size_t>(difference.name.kind)]) + "," +
             CsvField(difference.name.parent) + "," + CsvField(difference.name.child) + ",";
    }
    csv += RoundTrip(difference.distance_mm) + "," + RoundTrip(difference.angle_deg) + "," +
           RoundTrip(difference.sigma_mm) + "," + RoundTrip(difference.sigma_deg) + "," +
           RoundTrip(difference.p_value) + "," + Agreement(difference) + "\n";
  }
  return csv;
}

std::string ComparisonPage(const Comparison& comparison) {
  std::string body = "<h1>Comparison of " + std::to_string(comparison.runs.size()) + " runs</h1>\n<ul>\n";
  for (const std::string& finding : comparison.findings) {
    body += "<li>" + EscapedForMarkup(Capitalised(finding)) + "</li>\n";
  }
  return HtmlPage("Comparison of runs", body + "</ul>\n" + RunsPart(comparison) + DifferencesPart(comparison),
                  PageWidth::kWide);
}

}  // namespace heba
