#include "tools/pages/summary.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/pages/page.h"
#include "tools/pages/static_chart.h"
#include "tools/text/result_text.h"
#include "tools/text/rig_table.h"

namespace heba {
namespace {

// A figure of an estimate, with its names in the CSV file and on pages.
struct Figure {
  const char* name;
  const char* title;
  std::function<std::optional<double>(const Estimate&)> value;
};

const std::vector<Figure>& Figures() {
  static const std::vector<Figure> figures = {
      {"reprojection_rms_px", "in-sample, px", [](const Estimate& e) { return e.errors.reprojection_rms_px; }},
      {"holdout_rms_px", "hold-out, px", [](const Estimate& e) { return e.errors.holdout_rms_px; }},
      {"holdout_target_mm", "hold-out, mm", [](const Estimate& e) { return e.errors.holdout_target_mm; }},
      {"holdout_target_deg", "hold-out, deg", [](const Estimate& e) { return e.errors.holdout_target_deg; }},
      {"holdout_chi2_per_dof", "hold-out chi-square", [](const Estimate& e) { return e.errors.holdout_chi2; }},
      {"axxb_mean_mm", "AX-XB, mm", [](const Estimate& e) { return e.errors.axxb_mean_mm; }},
      {"board_translation_rms_mm", "board, mm",
       [](const Estimate& e) {
         return e.errors.board_scatter ? std::optional<double>(e.errors.board_scatter->translation_rms_mm)
                                       : std::nullopt;
       }},
      {"board_rotation_rms_deg", "board, deg",
       [](const Estimate& e) {
         return e.errors.board_scatter ? std::optional<double>(e.errors.board_scatter->rotation_rms_deg) : std::nullopt;
       }},
      {"std_translation_mm", "sigma, mm", [](const Estimate& e) { return TranslationSigmaMm(e); }},
      {"std_rotation_deg", "sigma, deg", [](const Estimate& e) { return RotationSigmaDeg(e); }},
      {"pixel_sigma", "pixel noise, px",
       [](const Estimate& e) { return e.solution ? std::optional<double>(e.solution->pixel_sigma_px) : std::nullopt; }},
      {"truth_hand_eye_mm", "true error, mm",
       [](const Estimate& e) {
         return e.errors.truth ? std::optional<double>(e.errors.truth->hand_eye_mm) : std::nullopt;
       }},
      {"truth_hand_eye_deg", "true error, deg",
       [](const Estimate& e) {
         return e.errors.truth ? std::optional<double>(e.errors.truth->hand_eye_deg) : std::nullopt;
       }},
  };
  return figures;
}

// Returns the figures of one camera of a rig, in the order of Figures().
std::vector<std::optional<double>> RigFigures(const RigResult& result, size_t camera) {
  const RigErrors& errors = result.errors[camera];
  const auto covariance = PoseCovarianceOf(result.solution.covariance, CameraPoseBlock(result.rig.cameras[camera]));
  return {errors.reprojection_rms_px,
          errors.holdout_rms_px,
          errors.holdout_target_mm,
          errors.holdout_target_deg,
          result.holdout_chi2,
          std::nullopt,
          std::nullopt,
          std::nullopt,
          1000 * std::sqrt(covariance->topLeftCorner<3, 3>().trace()),
          RadToDeg(std::sqrt(covariance->bottomRightCorner<3, 3>().trace())),
          result.solution.pixel_sigmas_px[camera],
          errors.truth_mm,
          errors.truth_deg};
}

// Returns the number of captures of which an image was used.
size_t NumUsedCaptures(const RigResult& result) {
  std::set<std::string> used;
  for (const RigImageResult& image : result.images) {
    if (image.used) used.insert(image.capture);
  }
  return used.size();
}

// Returns the types of a rig's targets.
std::string TargetTypes(const RigResult& result) { return Join(result.target_types, " "); }

std::string RigCsvLine(const std::string& name, const RigResult& result, size_t camera) {
  const RigCamera& of_rig = result.rig.cameras[camera];
  const auto [used, all] = CountImages(result, of_rig.name);
  std::string line = CsvField(name) + ",true,," + CsvField(MountText(result.rig, of_rig)) + "," +
                     CsvField(TargetTypes(result)) + ",," + std::to_string(all) + "," + std::to_string(used) + "," +
                     CsvField(of_rig.name) + ",refined,true," + std::string(GradeName(result.verdict.grade));
  for (const std::optional<double>& value : RigFigures(result, camera)) line += "," + (value ? RoundTrip(*value) : "");
  return line + "\n";
}

}  // namespace

std::string SummaryCsv(const std::vector<BatchRun>& runs) {
  std::string csv = "run,ok,reason,setup,target,target_points,captures,captures_used,method,kind,method_ok,verdict";
  for (const Figure& figure : Figures()) csv += "," + std::string(figure.name);
  csv += "\n";
  for (const BatchRun& run : runs) {
    if (run.rig) {
      for (size_t c = 0; c < run.rig->rig.cameras.size(); ++c) csv += RigCsvLine(run.name, *run.rig, c);
      continue;
    }
    if (!run.result) {
      csv += CsvField(run.name) + ",false," + CsvField(run.reason) + ",,,,,,,,,";
      csv += std::string(Figures().size(), ',') + "\n";
      continue;
    }
    const RunResult& result = *run.result;
    for (const Estimate& estimate : result.estimates) {
      csv += CsvField(run.name) + ",true," + CsvField(estimate.reason) + "," + std::string(SetupName(result.setup)) +
             "," + result.target_type + "," + std::to_string(result.num_target_points) + "," +
             std::to_string(result.captures.size()) + "," + std::to_string(NumUsedCaptures(result)) + "," +
             estimate.method + "," + std::string(EstimateKindName(estimate.kind)) + "," +
             (estimate.ok ? "true" : "false") + "," + std::string(GradeName(result.verdict.grade));
      for (const Figure& figure : Figures()) {
        const std::optional<double> value = estimate.ok ? figure.value(estimate) : std::nullopt;
        csv += "," + (value ? RoundTrip(*value) : "");
      }
      csv += "\n";
    }
  }
  return csv;
}

std::string SummaryPage(const std::string& title, const std::vector<BatchRun>& runs) {
  std::vector<std::string> head = {"run", "verdict", "setup or mount", "target", "used", "method or camera"};
  for (const Figure& figure : Figures()) head.emplace_back(figure.title);
  head.emplace_back("remark");
  std::vector<std::vector<PageCell>> rows;
  std::vector<std::vector<PageCell>> failed;
  for (const BatchRun& run : runs) {
    for (size_t c = 0; run.rig && c < run.rig->rig.cameras.size(); ++c) {
      const RigResult& rig = *run.rig;
      const auto [used, all] = CountImages(rig, rig.rig.cameras[c].name);
      std::vector<PageCell> row = {{run.name, false, LinkTo(run.name + "/report.html")},
                                   {std::string(GradeName(rig.verdict.grade))},
                                   {MountText(rig.rig, rig.rig.cameras[c])},
                                   {TargetTypes(rig)},
                                   {std::to_string(used) + " of " + std::to_string(all) + " images"},
                                   {"camera " + rig.rig.cameras[c].name}};
      for (const std::optional<double>& value : RigFigures(rig, c)) {
        row.push_back({value ? Significant(*value, 4) : "", true});
      }
      row.push_back({""});
      rows.push_back(std::move(row));
    }
    if (run.rig) continue;
    if (!run.result) {
      failed.push_back({{run.name}, {run.reason}});
      continue;
    }
    for (const Estimate& estimate : run.result->estimates) {
      std::vector<PageCell> row = {{run.name, false, LinkTo(run.name + "/report.html")},
                                   {std::string(GradeName(run.result->verdict.grade))},
                                   {std::string(SetupName(run.result->setup))},
                                   {run.result->target_type},
                                   {std::to_string(NumUsedCaptures(*run.result)) + " of " +
                                    std::to_string(run.result->captures.size()) + " captures"},
                                   {estimate.method}};
      for (const Figure& figure : Figures()) {
        const std::optional<double> value = estimate.ok ? figure.value(estimate) : std::nullopt;
        row.push_back({value ? Significant(*value, 4) : "", true});
      }
      row.push_back({estimate.reason});
      rows.push_back(std::move(row));
    }
  }
  const size_t num_failed = failed.size();
  const std::string counts =
      std::to_string(runs.size()) + " runs" +
      (num_failed > 0 ? ", " + std::to_string(num_failed) + " of them failed" : "") +
      ". In-sample: on the captures that the estimate was computed from; hold-out: on captures that "
      "it has not seen. Sigma: one sigma of the whole position or orientation of the camera, which is the root of the "
      "sum of "
      "the variances along or about its three axes.";
  using Json = nlohmann::ordered_json;
  Json bars = Json::array();
  std::vector<FigureRow> charted;
  for (const BatchRun& run : runs) {
    if (!run.result) continue;
    const Estimate* refined = FindRefined(*run.result);
    const Estimate* closed = FindBestClosedForm(*run.result, &HoldOutPx);
    const FigureRow row{run.name, refined != nullptr ? refined->errors.holdout_rms_px : std::nullopt,
                        closed != nullptr ? closed->errors.holdout_rms_px : std::nullopt};
    bars.push_back(Json{{"label", row.label}, {"values", {OrNull(row.first), OrNull(row.second)}}});
    charted.push_back(row);
  }
  return HtmlPage(
      title, "<h1>" + EscapedForMarkup(title) + "</h1>\n" + Paragraph(counts) +
                 ViewFigure("dumbbells", "Hold-out RMS of every run.",
                            Json{{"unit", "px"}, {"series", {"refined", "best closed form"}}, {"rows", bars}},
                            DumbbellChart("RMS in px: refined (first colour), best closed form (second)", charted)) +
                 (failed.empty() ? "" : Heading("Runs that failed") + HtmlTable({"run", "reason"}, failed)) +
                 Heading("Runs and methods") + HtmlTable(head, rows));
}

std::string SummaryTable(const std::vector<BatchRun>& runs) {
  constexpr size_t kNameWidth = 24;
  std::string table = PadRight("run", kNameWidth) + PadRight(" target or rig", 15) + PadLeft("captures", 9) +
                      PadLeft("hold-out px", 18) + PadLeft("sigma mm", 10) + "\n" + PadRight("", kNameWidth + 15 + 9) +
                      PadLeft("closed", 9) + PadLeft("refined", 9) + "\n";
  bool has_rig = false;
  for (const BatchRun& run : runs) {
    const std::string name =
        run.name.size() > kNameWidth ? run.name.substr(0, kNameWidth - 2) + ".." : PadRight(run.name, kNameWidth);
    table += name;
    if (run.rig) {
      std::optional<double> worst_px;
      std::optional<double> worst_mm;
      for (size_t c = 0; c < run.rig->rig.cameras.size(); ++c) {
        const std::vector<std::optional<double>> figures = RigFigures(*run.rig, c);
        worst_px = std::max(worst_px, figures[1]);
        worst_mm = std::max(worst_mm, figures[8]);
      }
      has_rig = true;
      const size_t num_cameras = run.rig->rig.cameras.size();
      table += PadRight(" rig, " + std::to_string(num_cameras) + " camera" + (num_cameras == 1 ? "" : "s"), 15) +
               PadLeft(std::to_string(NumUsedCaptures(*run.rig)) + "/" + std::to_string(run.rig->captures.size()), 9) +
               PadLeft("-", 9) + PadLeft(FigureText(worst_px), 9) + PadLeft(FigureText(worst_mm), 10) + "\n";
      continue;
    }
    const Estimate* refined = run.result ? FindRefined(*run.result) : nullptr;
    if (refined == nullptr) {
      table += " failed: " + run.reason + "\n";
      continue;
    }
    const RunResult& result = *run.result;
    const Estimate* closed = FindBestClosedForm(result, &HoldOutPx);
    table += PadRight(" " + result.target_type, 15) +
             PadLeft(std::to_string(NumUsedCaptures(result)) + "/" + std::to_string(result.captures.size()), 9) +
             PadLeft(FigureText(closed != nullptr ? closed->errors.holdout_rms_px : std::nullopt), 9) +
             PadLeft(FigureText(refined->errors.holdout_rms_px), 9) +
             PadLeft(FigureText(TranslationSigmaMm(*refined)), 10) + "\n";
  }
  if (has_rig) table += "of a rig: captures with a used image; hold-out px and sigma mm of the worst camera\n";
  return table;
}

}  // namespace heba
