#include "tools/study/study_report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string_view>

#include <nlohmann/json.hpp>

#include "heba/base/files.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/pages/page.h"
#include "tools/pages/plot.h"
#include "tools/pages/static_chart.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

std::string Ratio(double value, double bound) { return bound > 0 ? Significant(value / bound, 3) : "-"; }

// A quantity that a study varies and that can be the horizontal axis of a chart. Translation and rotation noise of
// the robot are swept as a pair.
struct SweptQuantity {
  const char* label;
  bool has_zero;  // True if the axis is linear, because zero is a possible value.
  double (*value)(const StudyLabels& labels);
};
constexpr SweptQuantity kQuantities[] = {
    {"pixel noise, px", false, [](const StudyLabels& l) { return l.pixel_sigma_px; }},
    {"captures", false, [](const StudyLabels& l) { return static_cast<double>(l.num_captures); }},
    {"points of the target", false, [](const StudyLabels& l) { return static_cast<double>(l.num_points); }},
    {"robot noise, mm", true, [](const StudyLabels& l) { return 1000 * l.robot_noise.translation_m; }},
    {"robot noise, deg", true, [](const StudyLabels& l) { return RadToDeg(l.robot_noise.rotation_rad); }},
    {"scale in x", true, [](const StudyLabels& l) { return l.shape_params[0]; }},
    {"scale in y", true, [](const StudyLabels& l) { return l.shape_params[1]; }},
    {"bend in x, mm", true, [](const StudyLabels& l) { return 1000 * l.shape_params[2]; }},
    {"bend in y, mm", true, [](const StudyLabels& l) { return 1000 * l.shape_params[3]; }},
    {"outlier points, %", true, [](const StudyLabels& l) { return 100 * l.outlier_points; }},
    {"wrong poses, %", true, [](const StudyLabels& l) { return 100 * l.wrong_captures; }}};
constexpr size_t kPixelNoise = 0;
constexpr size_t kNoQuantity = std::size(kQuantities);

bool IsRobotNoise(size_t quantity) { return std::string_view(kQuantities[quantity].label).starts_with("robot noise"); }

// Returns true if the description of a cell omits this quantity because the chart varies it.
bool IsSwept(size_t quantity, size_t swept) {
  return quantity == swept || (swept < kNoQuantity && IsRobotNoise(swept) && IsRobotNoise(quantity));
}

std::string SetupText(const StudyLabels& labels) {
  return labels.rig.empty() ? std::string(SetupName(labels.setup)) : labels.rig;
}

std::string IntrinsicsText(const StudyLabels& labels) {
  std::vector<std::string> names;
  for (const ParameterGroup group : labels.free_intrinsics) {
    names.emplace_back(kParameterGroupNames[static_cast<size_t>(group)]);
  }
  return Join(names, "+");
}

// Returns the errors of the cameras calibrated one by one relative to those of the joint calibration of a rig; nothing
// unless both were run and succeeded.
struct Gain {
  double of_translation = 0;
  double of_rotation = 0;
};
std::optional<Gain> GainOf(const CellResult& result) {
  const auto find = [&](RigEstimator estimator) {
    return std::find_if(result.methods.begin(), result.methods.end(), [&](const MethodSummary& method) {
      return method.method == kRigEstimatorNames[static_cast<size_t>(estimator)] &&
             method.num_failed < method.num_trials;
    });
  };
  const auto jointly = find(RigEstimator::kJointly);
  const auto one_by_one = find(RigEstimator::kOneByOne);
  if (jointly == result.methods.end() || one_by_one == result.methods.end()) return std::nullopt;
  return Gain{one_by_one->rms.hand_eye_m / jointly->rms.hand_eye_m,
              one_by_one->rms.hand_eye_rad / jointly->rms.hand_eye_rad};
}
bool IsJoint(const MethodSummary& method) {
  return method.method == kRigEstimatorNames[static_cast<size_t>(RigEstimator::kJointly)];
}

// Describes a cell without its pixel noise and without the swept quantity.
std::string SceneLine(const StudyLabels& labels, size_t swept = kPixelNoise) {
  const auto is_swept = [&](std::string_view label) {
    for (size_t i = 0; i < kNoQuantity; ++i) {
      if (kQuantities[i].label == label) return IsSwept(i, swept);
    }
    return false;
  };
  std::string line = labels.scene + " (" + SetupText(labels);
  if (!is_swept("captures")) line += ", " + std::to_string(labels.num_captures) + " captures";
  if (!is_swept("points of the target")) line += ", " + std::to_string(labels.num_points) + " points";
  line += ")";
  if (!is_swept("robot noise, mm") && (labels.robot_noise.translation_m > 0 || labels.robot_noise.rotation_rad > 0)) {
    line += ", robot " + Significant(1000 * labels.robot_noise.translation_m, 3) + " mm " +
            Significant(RadToDeg(labels.robot_noise.rotation_rad), 3) + " deg";
  }
  const std::array<double, TargetShape::kNumParams> designed = TargetShape().params;
  constexpr std::array<const char*, TargetShape::kNumParams> kShapes = {"scale in x", "scale in y", "bend in x, mm",
                                                                        "bend in y, mm"};
  for (size_t i = 0; i < designed.size(); ++i) {
    if (labels.shape_params[i] == designed[i] || is_swept(kShapes[i])) continue;
    line += std::string(", ") + (i % 2 == 0 ? "x " : "y ") +
            (i < 2 ? "scale " + Fixed(labels.shape_params[i], 4)
                   : "bend " + Significant(1000 * labels.shape_params[i], 3) + " mm");
  }
  line += ", refined with robot " + labels.robot_model;
  if (!labels.free_intrinsics.empty()) line += ", intrinsics " + IntrinsicsText(labels);
  if (!labels.kinematics.empty()) line += ", kinematics " + labels.kinematics;
  if (labels.outlier_points > 0 && !is_swept("outlier points, %")) {
    line += ", " + Significant(100 * labels.outlier_points, 3) + " % outlier points";
  }
  if (labels.wrong_captures > 0 && !is_swept("wrong poses, %")) {
    line += ", " + Significant(100 * labels.wrong_captures, 3) + " % wrong poses";
  }
  if (!labels.pose.empty()) line += ": " + labels.pose;
  return line;
}

// Describes the predictions of the target at the places of a cell whose robot has systematic errors.
std::string PlaceLines(const MethodSummary& method, const StudyErrors& bound) {
  std::string lines;
  if (method.estimated_effects) {
    lines +=
        PadRight("", 13) + "  errors of the arm estimated: " + Significant(100 * *method.estimated_effects, 3) + " %\n";
  }
  const auto add = [&](const char* where, const std::optional<double>& error_m, const std::optional<double>& bound_m,
                       const std::optional<double>& coverage) {
    if (!error_m || !bound_m) return;
    lines += PadRight("", 13) + "  target predicted " + where + ": " + Significant(1000 * *error_m, 3) + " mm, " +
             Ratio(*error_m, *bound_m) + " x bound, 95 % holds " + Fixed(coverage.value_or(0), 3) + "\n";
  };
  add("in captured configurations", method.rms.inside_m, bound.inside_m, method.coverage_inside);
  add("in other configurations", method.rms.outside_m, bound.outside_m, method.coverage_outside);
  return lines;
}

// Describes one pose of a rig: its bound and its estimators. The line is 80 characters wide.
std::string RigPoseLines(const CellResult& result) {
  std::string lines = "  " + result.labels.pose + "\n";
  const auto figures = [](const StudyErrors& errors) {
    return PadLeft(Significant(1000 * errors.hand_eye_m, 3), 12) +
           PadLeft(Significant(RadToDeg(errors.hand_eye_rad), 3), 11);
  };
  const StudyErrors& bound = *result.bound;
  lines += "    " + PadRight("bound", 11) + figures(bound) + "\n";
  const std::optional<Gain> gain = GainOf(result);
  for (const MethodSummary& method : result.methods) {
    lines += "    " + PadRight(method.method, 11);
    if (method.num_failed < method.num_trials) {
      lines += figures(method.rms) + PadLeft(Ratio(method.rms.hand_eye_m, bound.hand_eye_m), 9) +
               PadLeft(Ratio(method.rms.hand_eye_rad, bound.hand_eye_rad), 8) +
               PadLeft(method.coverage ? Fixed(*method.coverage, 3) : "-", 9);
      if (gain && IsJoint(method)) {
        lines += PadLeft(Significant(gain->of_translation, 3), 8) + PadLeft(Significant(gain->of_rotation, 3), 8);
      }
    }
    lines += "\n";
    if (method.num_failed > 0) {
      lines += PadRight("", 15) + "failed in " + std::to_string(method.num_failed) + " of " +
               std::to_string(method.num_trials) + " trials\n";
    }
  }
  return lines;
}

std::string OrEmpty(const std::optional<double>& value) { return value ? Significant(*value, 8) : ""; }

}  // namespace

std::string StudyTable(const std::vector<CellResult>& results) {
  std::string table;
  for (size_t i = 0; i < results.size(); ++i) {
    const CellResult& result = results[i];
    const bool is_first = i == 0 || results[i - 1].cell != result.cell;
    const bool is_last = i + 1 == results.size() || results[i + 1].cell != result.cell;
    if (is_first) {
      StudyLabels labels = result.labels;
      labels.pose.clear();
      table += SceneLine(labels) + ", pixel noise " + Significant(labels.pixel_sigma_px, 3) + " px\n";
    }
    if (!result.bound) {
      if (is_first) table += "  no bound: " + FailureText(result.bound.failure()) + "\n\n";
      continue;
    }
    if (!result.labels.pose.empty()) {
      if (is_first) {
        table += PadRight("", 15) + PadLeft("error", 23) + PadLeft("error / bound", 17) + PadLeft("95 %", 9) +
                 PadLeft("gain", 16) + "\n" + PadRight("", 15) + PadLeft("mm", 12) + PadLeft("deg", 11) +
                 PadLeft("mm", 9) + PadLeft("deg", 8) + PadLeft("holds", 9) + PadLeft("mm", 8) + PadLeft("deg", 8) +
                 "\n";
      }
      table += RigPoseLines(result) + (is_last ? "\n" : "");
      continue;
    }
    // The line is 80 characters wide.
    const auto figures = [](const StudyErrors& errors) {
      return PadLeft(Significant(1000 * errors.hand_eye_m, 3), 9) +
             PadLeft(Significant(RadToDeg(errors.hand_eye_rad), 3), 9) +
             PadLeft(Significant(1000 * errors.board_m.value_or(0), 3), 9) +
             PadLeft(Significant(RadToDeg(errors.board_rad.value_or(0)), 3), 9);
    };
    table += PadRight("", 13) + PadLeft("hand-eye", 18) + PadLeft("board", 18) + PadLeft("error / bound", 18) +
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
            PadRight("", 13) + "  correct error model chosen: " + Significant(100 * *method.right_model, 3) + " %\n";
      }
      table += PlaceLines(method, bound);
      if (method.robot_noise) {
        table += PadRight("", 13) + "  estimated (median): pixel noise " +
                 Significant(method.pixel_sigma_px.value_or(0), 3) + " px, robot " +
                 ShownNoise(1000 * method.robot_noise->translation_m) + " mm " +
                 ShownNoise(RadToDeg(method.robot_noise->rotation_rad)) + " deg\n";
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
      "found_pixel_sigma_px,found_robot_mm,found_robot_deg,kinematics,estimated_effects,inside_mm,bound_inside_mm,"
      "coverage_inside,outside_mm,bound_outside_mm,coverage_outside,pose,intrinsics,gain_mm,gain_deg\n";
  const auto columns = [](const std::optional<StudyErrors>& errors) {
    if (!errors) return std::string(",,,,");
    return Significant(1000 * errors->hand_eye_m, 8) + "," + Significant(RadToDeg(errors->hand_eye_rad), 8) + "," +
           (errors->board_m ? Significant(1000 * *errors->board_m, 8) : "") + "," +
           (errors->board_rad ? Significant(RadToDeg(*errors->board_rad), 8) : "") + "," + OrEmpty(errors->focal_px);
  };
  for (const CellResult& result : results) {
    const StudyLabels& labels = result.labels;
    const std::string cell =
        std::to_string(result.cell) + "," + CsvField(labels.scene) + "," +
        (labels.rig.empty() ? std::string(SetupName(labels.setup)) : "rig") + "," +
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
             (has_any && labels.pose.empty() ? Significant(method.axxb_mean_mm, 8) : "") + "," +
             OrEmpty(method.pixel_sigma_px) + ",";
      if (method.robot_noise) {
        csv += Significant(1000 * method.robot_noise->translation_m, 8) + "," +
               Significant(RadToDeg(method.robot_noise->rotation_rad), 8);
      } else {
        csv += ",";
      }
      const auto in_mm = [](const std::optional<double>& length_m) {
        return length_m ? Significant(1000 * *length_m, 8) : std::string();
      };
      const StudyErrors limits = bound.value_or(StudyErrors{});
      csv += "," + labels.kinematics + "," + OrEmpty(method.estimated_effects) + "," + in_mm(method.rms.inside_m) +
             "," + in_mm(limits.inside_m) + "," + OrEmpty(method.coverage_inside) + "," + in_mm(method.rms.outside_m) +
             "," + in_mm(limits.outside_m) + "," + OrEmpty(method.coverage_outside) + "," +
             CsvField(labels.pose.empty() ? "hand_eye" : labels.pose) + "," + IntrinsicsText(labels) + ",";
      const std::optional<Gain> gain = IsJoint(method) ? GainOf(result) : std::nullopt;
      csv += gain ? Significant(gain->of_translation, 8) + "," + Significant(gain->of_rotation, 8) + "\n" : ",\n";
    }
  }
  return csv;
}

namespace {

// A chart of one swept quantity with everything else constant.
struct StudyChart {
  size_t quantity = 0;
  Plot plot;
  bool has_linear_x = false;
  bool has_linear_y = false;
  std::optional<std::pair<double, double>> band;  // Expected range of the values on the vertical axis.
};

// Returns the groups of cells that differ in this quantity only. Groups with a single value are omitted.
std::vector<std::vector<const CellResult*>> SweepsOf(const std::vector<CellResult>& results, size_t quantity) {
  std::vector<std::string> order;
  std::map<std::string, std::vector<const CellResult*>> groups;
  for (const CellResult& result : results) {
    std::string key = Join({result.labels.scene, SetupText(result.labels), result.labels.pose,
                            result.labels.robot_model, result.labels.kinematics, IntrinsicsText(result.labels)},
                           "|");
    for (size_t i = 0; i < kNoQuantity; ++i) {
      if (!IsSwept(i, quantity)) key += "|" + RoundTrip(kQuantities[i].value(result.labels));
    }
    std::vector<const CellResult*>& group = groups[key];
    if (group.empty()) order.push_back(key);
    group.push_back(&result);
  }
  std::vector<std::vector<const CellResult*>> sweeps;
  for (const std::string& key : order) {
    std::vector<const CellResult*>& group = groups[key];
    std::set<double> values;
    for (const CellResult* result : group) values.insert(kQuantities[quantity].value(result->labels));
    // The rotation noise of the robot has no chart of its own if the translation noise varies too.
    const bool is_second_of_pair =
        IsRobotNoise(quantity) && IsRobotNoise(quantity - 1) &&
        std::any_of(group.begin(), group.end(), [&](const CellResult* result) {
          return kQuantities[quantity - 1].value(result->labels) != kQuantities[quantity - 1].value(group[0]->labels);
        });
    if (values.size() > 1 && !is_second_of_pair) sweeps.push_back(std::move(group));
  }
  return sweeps;
}

// Returns whether a method is the one that heba recommends.
bool IsEmphasised(const MethodSummary& method) { return method.method == kBundleMethod || IsJoint(method); }

using MethodFigure = std::optional<double> (*)(const MethodSummary& method);

std::vector<PlotLine> LinesOf(const std::vector<const CellResult*>& sweep, size_t quantity, MethodFigure figure) {
  std::vector<PlotLine> lines;
  for (const CellResult* result : sweep) {
    for (const MethodSummary& method : result->methods) {
      const std::optional<double> value = figure(method);
      if (!value) continue;
      auto line =
          std::find_if(lines.begin(), lines.end(), [&](const PlotLine& known) { return known.name == method.method; });
      if (line == lines.end()) {
        line = lines.insert(lines.end(), {method.method, {}, false, IsEmphasised(method)});
      }
      line->points.emplace_back(kQuantities[quantity].value(result->labels), *value);
    }
  }
  for (PlotLine& line : lines) std::sort(line.points.begin(), line.points.end());
  return lines;
}

// Describes a cell without the swept quantity, but with its pixel noise.
std::string TitleOf(const StudyLabels& labels, size_t swept) {
  return SceneLine(labels, swept) +
         (swept == kPixelNoise ? "" : ", pixel noise " + Significant(labels.pixel_sigma_px, 3) + " px");
}

// Plots the error of the hand-eye translation against the quantity, together with the bound.
StudyChart ErrorChart(const std::vector<const CellResult*>& sweep, size_t quantity) {
  StudyChart chart{quantity,
                   {TitleOf(sweep.front()->labels, quantity),
                    kQuantities[quantity].label,
                    sweep.front()->labels.pose.empty() ? "RMS error of the hand-eye translation, mm"
                                                       : "RMS error of the translation, mm",
                    {}},
                   kQuantities[quantity].has_zero,
                   false,
                   {}};
  PlotLine bound{"bound", {}, true, false};
  for (const CellResult* result : sweep) {
    if (!result->bound) continue;
    bound.points.emplace_back(kQuantities[quantity].value(result->labels), 1000 * result->bound->hand_eye_m);
  }
  std::sort(bound.points.begin(), bound.points.end());
  chart.plot.lines = LinesOf(sweep, quantity, [](const MethodSummary& method) -> std::optional<double> {
    return method.num_failed < method.num_trials ? std::optional(1000 * method.rms.hand_eye_m) : std::nullopt;
  });
  chart.plot.lines.insert(chart.plot.lines.begin(), bound);
  return chart;
}

// Plots the frequency with which the stated 95 % region holds the truth; the band is two sigma of a proportion of
// 0.95 for this number of trials.
std::optional<StudyChart> CoverageChart(const std::vector<const CellResult*>& sweep, size_t quantity) {
  StudyChart chart{quantity,
                   {TitleOf(sweep.front()->labels, quantity),
                    kQuantities[quantity].label,
                    "share of trials whose 95 % region contains the truth",
                    {}},
                   kQuantities[quantity].has_zero,
                   true,
                   {}};
  chart.plot.lines = LinesOf(sweep, quantity, [](const MethodSummary& method) { return method.coverage; });
  if (chart.plot.lines.empty()) return std::nullopt;
  int num_trials = 0;
  for (const MethodSummary& method : sweep.front()->methods) num_trials = std::max(num_trials, method.num_trials);
  const double sigma = std::sqrt(0.95 * 0.05 / std::max(num_trials, 1));
  chart.band = std::pair(0.95 - 2 * sigma, std::min(1.0, 0.95 + 2 * sigma));
  return chart;
}

// Returns the charts of every swept quantity, for each quantity errors before coverage.
std::vector<StudyChart> StudyCharts(const std::vector<CellResult>& results) {
  std::vector<StudyChart> charts;
  for (size_t quantity = 0; quantity < kNoQuantity; ++quantity) {
    const std::vector<std::vector<const CellResult*>> sweeps = SweepsOf(results, quantity);
    for (const auto& sweep : sweeps) charts.push_back(ErrorChart(sweep, quantity));
    for (const auto& sweep : sweeps) {
      if (std::optional<StudyChart> chart = CoverageChart(sweep, quantity)) charts.push_back(std::move(*chart));
    }
  }
  return charts;
}

std::string StaticChartOf(const StudyChart& chart) {
  ChartAxis x{chart.plot.x_label, INFINITY, -INFINITY, !chart.has_linear_x};
  ChartAxis y{chart.plot.y_label, INFINITY, -INFINITY, !chart.has_linear_y};
  const auto is_shown = [&](const std::pair<double, double>& point) {
    return (!x.is_log || point.first > 0) && (!y.is_log || point.second > 0);
  };
  std::vector<PlotLine> lines = chart.plot.lines;
  for (PlotLine& line : lines) {
    std::erase_if(line.points, [&](const auto& point) { return !is_shown(point); });
    for (const auto& [px, py] : line.points) {
      x.low = std::min(x.low, px);
      x.high = std::max(x.high, px);
      y.low = std::min(y.low, py);
      y.high = std::max(y.high, py);
    }
  }
  if (chart.band) {
    y.low = std::min(y.low, chart.band->first);
    y.high = std::max(y.high, chart.band->second);
  }
  if (!(x.low < x.high) || !(y.low <= y.high)) return "";
  if (y.is_log) {
    y.low /= 1.3;
    y.high *= 1.3;
  } else {
    const double room = 0.05 * std::max(y.high - y.low, 1e-3);
    y.low -= room;
    y.high += room;
  }
  StaticChart image(560, 340, x, y);
  if (chart.band) image.Bar(x.low, chart.band->first, x.high, chart.band->second, "dim", 0.15);
  for (const PlotLine& line : lines) {
    if (line.points.empty()) continue;
    image.Line(line.points, line.is_reference ? "dim" : (line.is_emphasised ? "second" : "first"),
               line.is_emphasised ? 3 : 1.2, line.is_reference);
    if (line.is_reference || line.is_emphasised) {
      image.Text(line.points.back().first, line.points.back().second, line.name, "end");
    }
  }
  return image.Svg();
}

std::string ChartFigure(const StudyChart& chart) {
  using Json = nlohmann::ordered_json;
  Json lines = Json::array();
  for (const PlotLine& line : chart.plot.lines) {
    Json points = Json::array();
    for (const auto& [x, y] : line.points) points.push_back({x, y});
    lines.push_back(Json{{"name", line.name},
                         {"reference", line.is_reference},
                         {"strong", line.is_emphasised},
                         {"points", std::move(points)}});
  }
  Json data{
      {"x_label", chart.plot.x_label}, {"y_label", chart.plot.y_label}, {"linear", Json::array()}, {"lines", lines}};
  if (chart.has_linear_x) data["linear"].push_back("x");
  if (chart.has_linear_y) data["linear"].push_back("y");
  if (chart.band) data["band"] = {chart.band->first, chart.band->second};
  return "<section>" + ViewFigure("lines", chart.plot.title, data, StaticChartOf(chart)) + "</section>\n";
}

}  // namespace

void WriteStudyPlots(const std::vector<CellResult>& results, const std::filesystem::path& folder) {
  const bool has_rig =
      std::any_of(results.begin(), results.end(), [](const CellResult& result) { return !result.labels.pose.empty(); });
  std::vector<Plot> plots;
  for (const StudyChart& chart : StudyCharts(results)) {
    if (chart.quantity == kPixelNoise && !chart.has_linear_y) plots.push_back(chart.plot);
  }
  for (size_t i = 0; i < plots.size(); ++i) {
    const std::string number = plots.size() > 1 ? "_" + std::to_string(i + 1) : "";
    WriteFileAtomically(folder / ((has_rig ? "pose_mm" : "hand_eye_mm") + number + ".svg"), LogLogSvg(plots[i]));
  }
}

namespace {

// Describes a cell with its pixel noise and without the pose of a rig.
std::string ConditionLine(StudyLabels labels) {
  labels.pose.clear();
  return SceneLine(labels) + ", pixel noise " + Significant(labels.pixel_sigma_px, 3) + " px";
}

// Returns charts of a study that varies nothing, one for each of its scenes: the errors beside the bound, for each pose
// of a rig or for each method.
std::string ConditionCharts(const std::vector<CellResult>& results) {
  using Json = nlohmann::ordered_json;
  struct Condition {
    bool is_rig = false;
    std::vector<std::string> series;
    Json rows = Json::array();
    std::vector<FigureRow> static_rows;
  };
  std::vector<std::string> order;
  std::map<std::string, Condition> conditions;
  for (const CellResult& result : results) {
    if (!result.bound) continue;
    const double bound_mm = 1000 * result.bound->hand_eye_m;
    std::vector<std::string> names;
    std::vector<std::optional<double>> errors_mm;
    for (const MethodSummary& method : result.methods) {
      names.push_back(method.method);
      errors_mm.push_back(method.num_failed < method.num_trials ? std::optional(1000 * method.rms.hand_eye_m)
                                                                : std::nullopt);
    }
    if (names.empty()) continue;
    const std::string line = ConditionLine(result.labels);
    if (conditions.count(line) == 0) order.push_back(line);
    Condition& condition = conditions[line];
    condition.is_rig = !result.labels.pose.empty();
    if (condition.is_rig) {
      condition.series = names;
      Json values = Json::array();
      for (const std::optional<double>& error_mm : errors_mm) values.push_back(OrNull(error_mm));
      values.push_back(bound_mm);
      condition.rows.push_back(Json{{"label", result.labels.pose}, {"values", values}});
      condition.static_rows.push_back({result.labels.pose, errors_mm.front(), bound_mm});
      continue;
    }
    condition.series = {"RMS error"};
    for (size_t i = 0; i < names.size(); ++i) {
      condition.rows.push_back(Json{{"label", names[i]},
                                    {"values", {OrNull(errors_mm[i]), bound_mm}},
                                    {"strong", IsEmphasised(result.methods[i])}});
      condition.static_rows.push_back({names[i], errors_mm[i], bound_mm});
    }
  }
  std::string charts;
  for (const std::string& line : order) {
    Condition& condition = conditions[line];
    const std::string first = condition.series.front();
    condition.series.emplace_back("bound");
    charts += ViewFigure(
        "dumbbells",
        line + ": RMS error of the " + (condition.is_rig ? "translation" : "hand-eye translation") + " and its bound.",
        Json{{"unit", "mm"}, {"series", condition.series}, {"rows", condition.rows}},
        DumbbellChart("mm: " + first + " (first colour), bound (second)", condition.static_rows));
  }
  return charts.empty() ? "" : Heading("Errors and bounds") + charts;
}

}  // namespace

std::string StudyPage(const std::string& title, const std::vector<CellResult>& results) {
  std::string body = "<h1>" + EscapedForMarkup(title) + "</h1>\n" +
                     Paragraph(
                         "RMS errors of every method, and the smallest error that any unbiased method "
                         "can reach (bound).");
  // The number of charts is limited for readability; study.csv holds the remaining figures.
  constexpr size_t kMostCharts = 60;
  const std::vector<StudyChart> charts = StudyCharts(results);
  std::string section;
  for (size_t i = 0; i < charts.size(); ++i) {
    const bool is_next_kind =
        i == 0 || charts[i].quantity != charts[i - 1].quantity || charts[i].has_linear_y != charts[i - 1].has_linear_y;
    if (is_next_kind) {
      body += section.empty() ? "" : "<div class=\"columns\">\n" + section + "</div>\n";
      section.clear();
      body += Heading((charts[i].has_linear_y ? "Coverage against " : "Error against ") + charts[i].plot.x_label);
    }
    if (i < kMostCharts) section += ChartFigure(charts[i]);
  }
  body += section.empty() ? "" : "<div class=\"columns\">\n" + section + "</div>\n";
  if (charts.empty()) body += ConditionCharts(results);
  if (charts.size() > kMostCharts) {
    body += Paragraph(std::to_string(charts.size() - kMostCharts) +
                      " further charts are not drawn; study.csv has their figures.");
  }
  const auto number = [](const std::optional<double>& value) {
    return PageCell{value ? Significant(*value, 3) : "", true};
  };
  const auto count = [](int value) { return PageCell{std::to_string(value), true}; };
  // There is one table for each scene; the properties that its cells share are its heading.
  std::vector<std::string> order;
  const std::vector<std::string> head = {"pixel noise, px", "method",      "hand-eye, mm", "deg",
                                         "mm / bound",      "deg / bound", "board, mm",    "95 % coverage",
                                         "AX-XB, mm",       "failed",      "trials"};
  const std::vector<std::string> rig_head = {
      "pixel noise, px", "pose",          "method",   "error, mm", "deg",    "mm / bound",
      "deg / bound",     "95 % coverage", "gain, mm", "gain, deg", "failed", "trials"};
  std::map<std::string, std::vector<std::string>> head_of;
  std::map<std::string, std::vector<std::vector<PageCell>>> rows_of;
  for (const CellResult& result : results) {
    const bool is_rig = !result.labels.pose.empty();
    StudyLabels labels = result.labels;
    labels.pose.clear();
    const std::string scene = SceneLine(labels);
    // The first cells of a row, up to the rotation error.
    const auto begin_row = [&](const std::string& method, bool is_strong, const std::optional<double>& error_m,
                               const std::optional<double>& error_rad) {
      std::vector<PageCell> row = {number(labels.pixel_sigma_px)};
      if (is_rig) row.push_back({result.labels.pose});
      row.push_back({method, false, {}, is_strong});
      row.push_back(number(error_m ? std::optional(1000 * *error_m) : std::nullopt));
      row.push_back(number(error_rad ? std::optional(RadToDeg(*error_rad)) : std::nullopt));
      return row;
    };
    if (rows_of.count(scene) == 0) {
      order.push_back(scene);
      head_of[scene] = is_rig ? rig_head : head;
    }
    if (result.bound) {
      const StudyErrors& bound = *result.bound;
      std::vector<PageCell>& row = rows_of[scene].emplace_back();
      row = begin_row("bound", false, bound.hand_eye_m, bound.hand_eye_rad);
      row.resize(head_of[scene].size(), PageCell{"", true});
      const auto board = std::find(head.begin(), head.end(), "board, mm");
      if (!is_rig && bound.board_m) row[static_cast<size_t>(board - head.begin())] = number(1000 * *bound.board_m);
    }
    for (const MethodSummary& method : result.methods) {
      const bool has_any = method.num_failed < method.num_trials;
      const StudyErrors& rms = method.rms;
      const auto of_bound = [&](double value, double StudyErrors::*member) -> std::optional<double> {
        if (!has_any || !result.bound || !((*result.bound).*member > 0)) return std::nullopt;
        return value / (*result.bound).*member;
      };
      const auto if_any = [&](double value) { return number(has_any ? std::optional<double>(value) : std::nullopt); };
      std::vector<PageCell>& row = rows_of[scene].emplace_back();
      row = begin_row(method.method, IsEmphasised(method), has_any ? std::optional(rms.hand_eye_m) : std::nullopt,
                      has_any ? std::optional(rms.hand_eye_rad) : std::nullopt);
      row.push_back(number(of_bound(rms.hand_eye_m, &StudyErrors::hand_eye_m)));
      row.push_back(number(of_bound(rms.hand_eye_rad, &StudyErrors::hand_eye_rad)));
      if (is_rig) {
        const std::optional<Gain> gain = IsJoint(method) ? GainOf(result) : std::nullopt;
        row.push_back(number(method.coverage));
        row.push_back(number(gain ? std::optional<double>(gain->of_translation) : std::nullopt));
        row.push_back(number(gain ? std::optional<double>(gain->of_rotation) : std::nullopt));
      } else {
        row.push_back(if_any(1000 * rms.board_m.value_or(0)));
        row.push_back(number(method.coverage));
        row.push_back(if_any(method.axxb_mean_mm));
      }
      row.push_back(count(method.num_failed));
      row.push_back(count(method.num_trials));
    }
  }
  body += Heading("All figures");
  constexpr size_t kFewScenes = 2;
  for (const std::string& scene : order) {
    std::vector<std::string>& columns = head_of[scene];
    std::vector<std::vector<PageCell>>& rows = rows_of[scene];
    std::string heading = scene;
    // The pixel noise is part of the heading if all rows have the same.
    const std::string noise = rows.empty() ? "" : rows.front().front().text;
    if (std::all_of(rows.begin(), rows.end(), [&](const auto& row) { return row.front().text == noise; })) {
      heading += ", pixel noise " + noise + " px";
      columns.erase(columns.begin());
      for (std::vector<PageCell>& row : rows) row.erase(row.begin());
    }
    const std::string table = HtmlTable(columns, rows);
    body +=
        order.size() <= kFewScenes ? "<h3>" + EscapedForMarkup(heading) + "</h3>\n" + table : Details(heading, table);
  }
  return HtmlPage(title, body, PageWidth::kWide);
}

}  // namespace heba
