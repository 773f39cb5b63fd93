#include "tools/study_report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/page.h"
#include "tools/plot.h"
#include "tools/run_figures.h"

namespace heba {
namespace {

std::string Ratio(double value, double bound) { return bound > 0 ? Significant(value / bound, 3) : "-"; }

// What a cell is, without its pixel noise.
std::string SceneLine(const StudyLabels& labels) {
  std::string line = labels.scene + " (" + std::string(SetupName(labels.setup)) + ", " +
                     std::to_string(labels.num_captures) + " captures, " + std::to_string(labels.num_points) +
                     " points)";
  if (labels.robot_noise.translation_m > 0 || labels.robot_noise.rotation_rad > 0) {
    line += ", robot " + Significant(1000 * labels.robot_noise.translation_m, 3) + " mm " +
            Significant(RadToDeg(labels.robot_noise.rotation_rad), 3) + " deg";
  }
  const std::array<double, TargetShape::kNumParams> designed = TargetShape().params;
  for (size_t i = 0; i < designed.size(); ++i) {
    if (labels.shape_params[i] == designed[i]) continue;
    line += std::string(", ") + (i % 2 == 0 ? "x " : "y ") +
            (i < 2 ? "scale " + Fixed(labels.shape_params[i], 4)
                   : "bend " + Significant(1000 * labels.shape_params[i], 3) + " mm");
  }
  line += ", refined with robot " + labels.robot_model;
  if (labels.outlier_points > 0) line += ", " + Significant(100 * labels.outlier_points, 3) + " % of points anywhere";
  if (labels.wrong_captures > 0) line += ", " + Significant(100 * labels.wrong_captures, 3) + " % of poses wrong";
  return line;
}

std::string OrEmpty(const std::optional<double>& value) { return value ? Significant(*value, 8) : ""; }

}  // namespace

std::string StudyTable(const std::vector<CellResult>& results) {
  std::string table;
  for (const CellResult& result : results) {
    table += SceneLine(result.labels) + ", pixel noise " + Significant(result.labels.pixel_sigma_px, 3) + " px\n";
    if (!result.bound) {
      table += "  no bound: " + result.bound.reason() + "\n\n";
      continue;
    }
    // 80 characters in all.
    const auto figures = [](const StudyErrors& errors) {
      return PadLeft(Significant(1000 * errors.hand_eye_m, 3), 9) +
             PadLeft(Significant(RadToDeg(errors.hand_eye_rad), 3), 9) +
             PadLeft(Significant(1000 * errors.board_m, 3), 9) + PadLeft(Significant(RadToDeg(errors.board_rad), 3), 9);
    };
    table += PadRight("", 13) + PadLeft("hand-eye", 18) + PadLeft("board", 18) + PadLeft("over the bound", 18) +
             PadLeft("95 %", 6) + PadLeft("AX-XB", 7) + "\n" + PadRight("", 13) + PadLeft("mm", 9) + PadLeft("deg", 9) +
             PadLeft("mm", 9) + PadLeft("deg", 9) + PadLeft("mm", 6) + PadLeft("deg", 6) + PadLeft("focal", 6) +
             PadLeft("holds", 6) + PadLeft("mm", 7) + "\n";
    const StudyErrors& bound = *result.bound;
    table += "  " + PadRight("bound", 11) + figures(bound) + "\n";
    for (const MethodSummary& method : result.methods) {
      table += "  " + PadRight(method.method, 11);
      if (method.num_failed < method.num_trials) {
        const StudyErrors& rms = method.rms;
        table += figures(rms) + PadLeft(Ratio(rms.hand_eye_m, bound.hand_eye_m), 6) +
                 PadLeft(Ratio(rms.hand_eye_rad, bound.hand_eye_rad), 6) +
                 PadLeft(rms.focal_px && bound.focal_px ? Ratio(*rms.focal_px, *bound.focal_px) : "-", 6) +
                 PadLeft(method.coverage ? Fixed(*method.coverage, 3) : "-", 6) +
                 PadLeft(Significant(method.axxb_mean_mm, 3), 7);
      }
      table += "\n";
      if (method.num_failed > 0) {
        table += PadRight("", 13) + "  failed in " + std::to_string(method.num_failed) + " of " +
                 std::to_string(method.num_trials) + " trials\n";
      }
      if (method.right_model) {
        table +=
            PadRight("", 13) + "  right model of the errors: " + Significant(100 * *method.right_model, 3) + " %\n";
      }
      if (method.robot_noise) {
        table += PadRight("", 13) + "  found (median): pixels " + Significant(method.pixel_sigma_px.value_or(0), 3) +
                 " px, robot " + Significant(1000 * method.robot_noise->translation_m, 3) + " mm " +
                 Significant(RadToDeg(method.robot_noise->rotation_rad), 3) + " deg\n";
      }
    }
    table += "\n";
  }
  return table;
}

std::string StudyCsv(const std::vector<CellResult>& results) {
  std::string csv =
      "cell,scene,setup,captures,points,pixel_noise_px,robot_translation_mm,robot_rotation_deg,scale_x,scale_y,bend_x_"
      "mm,bend_y_mm,outlier_points,"
      "wrong_captures,robot_model,method,trials,failed,hand_eye_mm,hand_eye_deg,board_mm,board_deg,focal_px,"
      "bound_hand_eye_mm,bound_hand_eye_deg,bound_board_mm,bound_board_deg,bound_focal_px,coverage_95,right_model,axxb_"
      "mean_mm,"
      "found_pixel_sigma_px,found_robot_mm,found_robot_deg\n";
  const auto columns = [](const std::optional<StudyErrors>& errors) {
    if (!errors) return std::string(",,,,");
    return Significant(1000 * errors->hand_eye_m, 8) + "," + Significant(RadToDeg(errors->hand_eye_rad), 8) + "," +
           Significant(1000 * errors->board_m, 8) + "," + Significant(RadToDeg(errors->board_rad), 8) + "," +
           OrEmpty(errors->focal_px);
  };
  for (const CellResult& result : results) {
    const StudyLabels& labels = result.labels;
    const std::string cell =
        std::to_string(result.cell) + "," + CsvField(labels.scene) + "," + std::string(SetupName(labels.setup)) + "," +
        std::to_string(labels.num_captures) + "," + std::to_string(labels.num_points) + "," +
        Significant(labels.pixel_sigma_px, 8) + "," + Significant(1000 * labels.robot_noise.translation_m, 8) + "," +
        Significant(RadToDeg(labels.robot_noise.rotation_rad), 8) + "," + Significant(labels.shape_params[0], 8) + "," +
        Significant(labels.shape_params[1], 8) + "," + Significant(1000 * labels.shape_params[2], 8) + "," +
        Significant(1000 * labels.shape_params[3], 8) + "," + Significant(labels.outlier_points, 8) + "," +
        Significant(labels.wrong_captures, 8) + "," + labels.robot_model;
    for (const MethodSummary& method : result.methods) {
      const bool has_any = method.num_failed < method.num_trials;
      const std::optional<StudyErrors> bound = result.bound ? std::optional<StudyErrors>(*result.bound) : std::nullopt;
      csv += cell + "," + method.method + "," + std::to_string(method.num_trials) + "," +
             std::to_string(method.num_failed) + "," +
             columns(has_any ? std::optional<StudyErrors>(method.rms) : std::nullopt) + "," + columns(bound) + "," +
             OrEmpty(method.coverage) + "," + OrEmpty(method.right_model) + "," +
             (has_any ? Significant(method.axxb_mean_mm, 8) : "") + "," + OrEmpty(method.pixel_sigma_px) + ",";
      if (method.robot_noise) {
        csv += Significant(1000 * method.robot_noise->translation_m, 8) + "," +
               Significant(RadToDeg(method.robot_noise->rotation_rad), 8);
      } else {
        csv += ",";
      }
      csv += "\n";
    }
  }
  return csv;
}

namespace {

// The hand-eye translation's error against the pixel noise, a plot for each scene and everything else that varies; none
// if the noise does not.
std::vector<Plot> StudyPlots(const std::vector<CellResult>& results) {
  std::set<double> sigmas;
  std::map<std::string, std::vector<const CellResult*>> groups;
  std::vector<std::string> order;
  for (const CellResult& result : results) {
    sigmas.insert(result.labels.pixel_sigma_px);
    std::vector<const CellResult*>& group = groups[SceneLine(result.labels)];
    if (group.empty()) order.push_back(SceneLine(result.labels));
    group.push_back(&result);
  }
  std::vector<Plot> plots;
  if (sigmas.size() < 2) return plots;
  for (size_t g = 0; g < order.size(); ++g) {
    Plot plot{order[g], "pixel noise, px", "RMS error of the hand-eye translation, mm", {}};
    PlotLine bound{"bound", {}, true, false};
    std::map<std::string, PlotLine> lines;
    std::vector<std::string> names;
    for (const CellResult* result : groups[order[g]]) {
      const double x = result->labels.pixel_sigma_px;
      if (result->bound) bound.points.emplace_back(x, 1000 * result->bound->hand_eye_m);
      for (const MethodSummary& method : result->methods) {
        PlotLine& line = lines[method.method];
        if (line.name.empty()) names.push_back(method.method);
        line.name = method.method;
        line.is_emphasised = method.method == kBundleMethod;
        line.points.emplace_back(x, 1000 * method.rms.hand_eye_m);
      }
    }
    plot.lines.push_back(bound);
    for (const std::string& name : names) plot.lines.push_back(lines[name]);
    for (PlotLine& line : plot.lines) std::sort(line.points.begin(), line.points.end());
    plots.push_back(std::move(plot));
  }
  return plots;
}

}  // namespace

void WriteStudyPlots(const std::vector<CellResult>& results, const std::filesystem::path& folder) {
  const std::vector<Plot> plots = StudyPlots(results);
  for (size_t i = 0; i < plots.size(); ++i) {
    const std::string number = plots.size() > 1 ? "_" + std::to_string(i + 1) : "";
    WriteFileAtomically(folder / ("hand_eye_mm" + number + ".svg"), LogLogSvg(plots[i]));
  }
}

std::string StudyPage(const std::string& title, const std::vector<CellResult>& results) {
  using Json = nlohmann::ordered_json;
  std::string body = "<h1>" + EscapedForMarkup(title) + "</h1>\n" +
                     Paragraph(
                         "RMS errors against the truth, of every method, and the least that any unbiased method "
                         "can reach (bound).");
  for (const Plot& plot : StudyPlots(results)) {
    Json lines = Json::array();
    for (const PlotLine& line : plot.lines) {
      Json points = Json::array();
      for (const auto& [x, y] : line.points) points.push_back({x, y});
      lines.push_back(Json{{"name", line.name},
                           {"reference", line.is_reference},
                           {"strong", line.is_emphasised},
                           {"points", std::move(points)}});
    }
    body +=
        ViewFigure("lines", plot.title, Json{{"x_label", plot.x_label}, {"y_label", plot.y_label}, {"lines", lines}});
  }
  std::vector<std::vector<PageCell>> rows;
  const auto number = [](const std::optional<double>& value) {
    return PageCell{value ? Significant(*value, 3) : "", true};
  };
  for (const CellResult& result : results) {
    for (const MethodSummary& method : result.methods) {
      const bool has_any = method.num_failed < method.num_trials;
      const StudyErrors& rms = method.rms;
      const auto of_bound = [&](double value, double StudyErrors::*member) -> std::optional<double> {
        if (!has_any || !result.bound || !((*result.bound).*member > 0)) return std::nullopt;
        return value / (*result.bound).*member;
      };
      rows.push_back({{SceneLine(result.labels)},
                      number(result.labels.pixel_sigma_px),
                      {method.method},
                      number(has_any ? std::optional<double>(1000 * rms.hand_eye_m) : std::nullopt),
                      number(has_any ? std::optional<double>(RadToDeg(rms.hand_eye_rad)) : std::nullopt),
                      number(of_bound(rms.hand_eye_m, &StudyErrors::hand_eye_m)),
                      number(of_bound(rms.hand_eye_rad, &StudyErrors::hand_eye_rad)),
                      number(has_any ? std::optional<double>(1000 * rms.board_m) : std::nullopt),
                      number(method.coverage),
                      number(has_any ? std::optional<double>(method.axxb_mean_mm) : std::nullopt),
                      number(method.num_failed),
                      number(method.num_trials)});
    }
  }
  return HtmlPage(title,
                  body + HtmlTable({"scene", "pixel noise, px", "method", "hand-eye, mm", "deg", "mm over the bound",
                                    "deg over the bound", "board, mm", "95 % holds", "AX-XB, mm", "failed", "trials"},
                                   rows));
}

}  // namespace heba
