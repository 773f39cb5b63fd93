#include "tools/pages/summary.h"

#include <algorithm>
#include <tuple>

#include "heba/base/text.h"
#include "heba/data/hand_eye.h"
#include "tools/pages/page.h"
#include "tools/text/camera_figures.h"
#include "tools/text/figure_columns.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

// A figure, with its names in the CSV file and on pages.
struct Figure {
  const char* name;
  const char* title;
  std::optional<double> CameraFigures::*value;
};

constexpr Figure kFigures[] = {
    {"reprojection_rms_px", "in-sample, px", &CameraFigures::reprojection_rms_px},
    {"holdout_rms_px", "hold-out, px", &CameraFigures::holdout_rms_px},
    {"holdout_target_mm", "hold-out, mm", &CameraFigures::holdout_target_mm},
    {"holdout_target_deg", "hold-out, deg", &CameraFigures::holdout_target_deg},
    {"holdout_chi2_per_dof", "hold-out chi-square", &CameraFigures::holdout_chi2},
    {"axxb_mean_mm", "AX-XB, mm", &CameraFigures::axxb_mean_mm},
    {"board_translation_rms_mm", "board, mm", &CameraFigures::board_mm},
    {"board_rotation_rms_deg", "board, deg", &CameraFigures::board_deg},
    {"std_translation_mm", "sigma, mm", &CameraFigures::sigma_mm},
    {"std_rotation_deg", "sigma, deg", &CameraFigures::sigma_deg},
    {"pixel_sigma", "pixel noise, px", &CameraFigures::pixel_sigma_px},
    {"truth_hand_eye_mm", "true error, mm", &CameraFigures::truth_mm},
    {"truth_hand_eye_deg", "true error, deg", &CameraFigures::truth_deg},
};

// A row has the estimate of one method for a single camera, or the result for one camera of a rig.
struct Row {
  std::string setup;       // Or the mount of a camera of a rig.
  std::string target;      // The type, or those of a rig.
  std::string num_points;  // The number of points of the target; empty for a rig.
  int num_used = 0;        // Number of captures, or of images of a camera of a rig.
  int num_all = 0;
  std::string method;  // Or the name of a camera of a rig.
  EstimateKind kind = EstimateKind::kRefined;
  bool ok = true;
  std::string reason;  // Reason of a failure.
  CameraFigures figures;
};

// Returns the rows of one camera whose parts have no names.
std::vector<Row> RowsOfMethods(const RunResult& result) {
  std::vector<Row> rows;
  for (const Estimate& estimate : result.estimates) {
    rows.push_back({std::string(SetupName(SetupOf(result.rig.cameras[0].mount))), result.target_types[0],
                    std::to_string(result.num_target_points[0]), NumUsedCaptures(result), NumCaptures(result),
                    estimate.method, estimate.kind, estimate.ok, estimate.reason.ToString(),
                    FiguresOf(estimate.ok ? &estimate : nullptr)});
  }
  return rows;
}

std::vector<Row> RowsOf(const RunResult& result) {
  if (IsShort(result)) return RowsOfMethods(result);
  std::vector<Row> rows;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const ProblemCamera& camera = result.rig.cameras[c];
    Row& row = rows.emplace_back();
    row.setup = MountText(result.rig, camera);
    row.target = Join(result.target_types, " ");
    std::tie(row.num_used, row.num_all) = CountImages(result, camera.name);
    row.method = camera.name;
    row.figures = FiguresOf(result, c);
  }
  return rows;
}

// A run as one line: its refined estimate or, of a rig, the worst camera.
struct RunLine {
  std::string name;
  std::string target;
  std::string captures;
  std::optional<double> closed_px = {};  // The best closed form has this error; a rig has none.
  std::optional<double> refined_px = {};
  std::optional<double> sigma_mm = {};
};

RunLine LineOf(const BatchRun& run) {
  const RunResult& result = *run.result;
  RunLine line{run.name, "", std::to_string(NumUsedCaptures(result)) + "/" + std::to_string(NumCaptures(result))};
  if (IsShort(result)) {
    const CameraFigures refined = FiguresOf(FindRefined(result));
    line.target = result.target_types[0];
    line.closed_px = FiguresOf(FindBestClosedForm(result, &HoldOutPx)).holdout_rms_px;
    line.refined_px = refined.holdout_rms_px;
    line.sigma_mm = refined.sigma_mm;
    return line;
  }
  const size_t num_cameras = result.rig.cameras.size();
  line.target = "rig, " + std::to_string(num_cameras) + (num_cameras == 1 ? " camera" : " cameras");
  for (const Row& row : RowsOf(result)) {
    line.refined_px = std::max(line.refined_px, row.figures.holdout_rms_px);
    line.sigma_mm = std::max(line.sigma_mm, row.figures.sigma_mm);
  }
  return line;
}

// Returns the chart of the hold-out errors of the runs that have a result.
std::string HoldOutFigure(const std::vector<BatchRun>& runs) {
  using Json = nlohmann::ordered_json;
  Json bars = Json::array();
  for (const BatchRun& run : runs) {
    if (!run.result) continue;
    const RunLine line = LineOf(run);
    bars.push_back(Json{{"label", line.name}, {"values", {OrNull(line.refined_px), OrNull(line.closed_px)}}});
  }
  return ViewFigure("dumbbells", "Hold-out RMS of every run; that of a rig is the one of its worst camera.",
                    Json{{"unit", "px"}, {"series", {"refined", "best closed form"}}, {"rows", bars}});
}

std::vector<PageCell> PageRow(const BatchRun& run, const Row& row) {
  const bool is_rig = !IsShort(*run.result);
  std::vector<PageCell> cells = {
      {run.name, false, LinkTo(run.name + "/report.html")},
      {std::string(GradeName(run.verdict()->grade))},
      {row.setup},
      {row.target},
      {std::to_string(row.num_used) + " of " + std::to_string(row.num_all) + (is_rig ? " images" : " captures")},
      {(is_rig ? "camera " : "") + row.method}};
  for (const Figure& figure : kFigures) {
    const std::optional<double>& value = row.figures.*figure.value;
    cells.push_back({value ? Significant(*value, 4) : "", true});
  }
  cells.push_back({row.reason});
  return cells;
}

}  // namespace

std::string SummaryCsv(const std::vector<BatchRun>& runs) {
  std::vector<std::string> head = {"run",           "ok",       "reason",        "setup",  "target",
                                   "target_points", "captures", "captures_used", "method", "kind",
                                   "method_ok",     "verdict"};
  for (const Figure& figure : kFigures) head.emplace_back(figure.name);
  std::string csv = Join(head, ",") + "\n";
  for (const BatchRun& run : runs) {
    if (!run.result) {
      std::vector<std::string> fields = {CsvField(run.name), "false", CsvField(run.reason)};
      fields.resize(head.size());
      csv += Join(fields, ",") + "\n";
      continue;
    }
    for (const Row& row : RowsOf(*run.result)) {
      std::vector<std::string> fields = {CsvField(run.name),          "true",
                                         CsvField(row.reason),        CsvField(row.setup),
                                         CsvField(row.target),        row.num_points,
                                         std::to_string(row.num_all), std::to_string(row.num_used),
                                         CsvField(row.method),        std::string(EstimateKindName(row.kind)),
                                         row.ok ? "true" : "false",   std::string(GradeName(run.verdict()->grade))};
      for (const Figure& figure : kFigures) {
        const std::optional<double>& value = row.figures.*figure.value;
        fields.push_back(value ? RoundTrip(*value) : "");
      }
      csv += Join(fields, ",") + "\n";
    }
  }
  return csv;
}

std::string SummaryPage(const std::string& title, const std::vector<BatchRun>& runs) {
  std::vector<std::string> head = {"run", "verdict", "setup or mount", "target", "used", "method or camera"};
  for (const Figure& figure : kFigures) head.emplace_back(figure.title);
  head.emplace_back("remark");
  std::vector<std::vector<PageCell>> rows;
  std::vector<std::vector<PageCell>> failed;
  for (const BatchRun& run : runs) {
    if (!run.result) {
      failed.push_back({{run.name}, {run.reason}});
      continue;
    }
    for (const Row& row : RowsOf(*run.result)) rows.push_back(PageRow(run, row));
  }
  const std::string counts =
      std::to_string(runs.size()) + " runs" +
      (failed.empty() ? "" : ", " + std::to_string(failed.size()) + " of them failed") +
      ". In-sample: on the captures that the estimate was computed from; hold-out: on captures that it has not seen. "
      "Sigma: one sigma of the whole position or orientation of the camera, which is the root of the sum of the "
      "variances along or about its three axes.";
  return HtmlPage(title,
                  "<h1>" + EscapedForMarkup(title) + "</h1>\n" + Paragraph(counts) + HoldOutFigure(runs) +
                      (failed.empty() ? "" : Heading("Runs that failed") + HtmlTable({"run", "reason"}, failed)) +
                      Heading("Runs and methods") + HtmlTable(head, rows));
}

std::string SummaryTable(const std::vector<BatchRun>& runs) {
  constexpr size_t kNameWidth = 24;
  constexpr size_t kTargetWidth = 15;
  constexpr size_t kCapturesWidth = 9;
  const std::vector<FigureColumn<RunLine>> columns = {{"", "closed", 9, 3, &RunLine::closed_px},
                                                      {"hold-out px", "refined", 9, 3, &RunLine::refined_px},
                                                      {"sigma mm", "", 10, 3, &RunLine::sigma_mm}};
  const std::string head =
      PadRight("run", kNameWidth) + PadRight(" target or rig", kTargetWidth) + PadLeft("captures", kCapturesWidth);
  std::string table = ColumnHeads(head, std::string(head.size(), ' '), columns);
  bool has_rig = false;
  for (const BatchRun& run : runs) {
    table += run.name.size() > kNameWidth ? run.name.substr(0, kNameWidth - 2) + ".." : PadRight(run.name, kNameWidth);
    if (!run.result) {
      table += " failed: " + run.reason + "\n";
      continue;
    }
    has_rig = has_rig || !IsShort(*run.result);
    const RunLine line = LineOf(run);
    table += PadRight(" " + line.target, kTargetWidth) + PadLeft(line.captures, kCapturesWidth) +
             FigureCells(columns, line) + "\n";
  }
  if (has_rig) table += "of a rig: captures with a used image; hold-out px and sigma mm of the worst camera\n";
  return table;
}

}  // namespace heba
