#include "tools/study/study_page.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "tools/pages/page.h"

namespace heba {
namespace {

using Json = nlohmann::ordered_json;

// A kind of chart that every sweep has.
struct ChartKind {
  const char* heading;
  const char* y_label;          // The label for a hand-eye calibration.
  const char* y_label_of_pose;  // The label for a pose of named cameras.
  std::optional<double> (*figure)(const StudyRow& row);
  bool is_share;  // Shares have a linear axis and their expected range, others a logarithmic one and the bound.
};
constexpr ChartKind kChartKinds[] = {
    {"Error against ", "RMS error of the hand-eye translation, mm", "RMS error of the translation, mm",
     [](const StudyRow& row) { return row.errors.hand_eye_mm; }, false},
    {"Coverage against ", "share of trials whose 95 % region contains the truth",
     "share of trials whose 95 % region contains the truth", [](const StudyRow& row) { return row.coverage; }, true}};

// The results that differ in one quantity only.
using Sweep = std::vector<const CellResult*>;

// Returns the sweeps of a quantity; those with a single value are omitted.
std::vector<Sweep> SweepsOf(const std::vector<CellResult>& results, size_t quantity) {
  std::vector<std::string> order;
  std::map<std::string, Sweep> groups;
  for (const CellResult& result : results) {
    const StudyLabels& labels = result.labels;
    std::string key = Join(
        {labels.scene, SetupText(labels), labels.pose, labels.robot_model, labels.kinematics, IntrinsicsText(labels)},
        "|");
    for (size_t i = 0; i < kNumQuantities; ++i) {
      if (!IsSwept(i, quantity)) key += "|" + RoundTrip(kQuantities[i].value(labels));
    }
    Sweep& group = groups[key];
    if (group.empty()) order.push_back(key);
    group.push_back(&result);
  }
  const auto varies = [](const Sweep& sweep, size_t which) {
    std::set<double> values;
    for (const CellResult* result : sweep) values.insert(kQuantities[which].value(result->labels));
    return values.size() > 1;
  };
  std::vector<Sweep> sweeps;
  for (const std::string& key : order) {
    Sweep& group = groups[key];
    // The rotation noise of the robot has no chart of its own if the translation noise varies too.
    const bool is_second_of_pair = quantity == kRobotDeg && varies(group, kRobotMm);
    if (varies(group, quantity) && !is_second_of_pair) sweeps.push_back(std::move(group));
  }
  return sweeps;
}

// Returns the chart of a sweep; empty if there are no figures.
std::string SweepChart(const Sweep& sweep, size_t quantity, const ChartKind& kind) {
  std::vector<Json> lines;
  std::map<std::string, size_t> line_of;
  int num_trials = 1;
  for (const bool is_bound : {true, false}) {
    for (const CellResult* result : sweep) {
      for (const StudyRow& row : RowsOf(*result)) {
        const std::optional<double> figure = kind.figure(row);
        if (!figure || (row.method == nullptr) != is_bound) continue;
        const auto [found, is_new] = line_of.emplace(row.name, lines.size());
        if (is_new) {
          lines.push_back(
              {{"name", row.name}, {"reference", is_bound}, {"strong", row.is_emphasised}, {"points", Json::array()}});
        }
        lines[found->second]["points"].push_back({kQuantities[quantity].value(result->labels), *figure});
        if (!is_bound) num_trials = std::max(num_trials, row.method->num_trials);
      }
    }
  }
  if (lines.empty()) return "";
  for (Json& line : lines) std::sort(line["points"].begin(), line["points"].end());
  const StudyLabels& labels = sweep.front()->labels;
  Json data{{"x_label", kQuantities[quantity].label},
            {"y_label", labels.pose.empty() ? kind.y_label : kind.y_label_of_pose},
            {"linear", Json::array()},
            {"lines", lines}};
  if (kQuantities[quantity].has_zero) data["linear"].push_back("x");
  if (kind.is_share) {
    data["linear"].push_back("y");
    // Two sigma of a proportion of 0.95 for this number of trials.
    const double sigma = std::sqrt(0.95 * 0.05 / num_trials);
    data["band"] = {0.95 - 2 * sigma, std::min(1.0, 0.95 + 2 * sigma)};
  }
  const std::string title = SceneLine(labels, quantity) + (quantity == kPixelNoise ? "" : PixelNoiseText(labels));
  return "<section>" + ViewFigure("lines", title, data) + "</section>\n";
}

// Returns the charts of every swept quantity, for each quantity errors before coverage.
std::string SweepCharts(const std::vector<CellResult>& results) {
  // The number of charts is limited for readability; study.csv holds the remaining figures.
  constexpr size_t kMostCharts = 60;
  size_t num_charts = 0;
  std::string charts;
  for (size_t quantity = 0; quantity < kNumQuantities; ++quantity) {
    const std::vector<Sweep> sweeps = SweepsOf(results, quantity);
    for (const ChartKind& kind : kChartKinds) {
      std::string section;
      size_t num_of_kind = 0;
      for (const Sweep& sweep : sweeps) {
        const std::string chart = SweepChart(sweep, quantity, kind);
        if (chart.empty()) continue;
        ++num_of_kind;
        if (num_charts++ < kMostCharts) section += chart;
      }
      if (num_of_kind == 0) continue;
      charts += Heading(kind.heading + std::string(kQuantities[quantity].label));
      if (!section.empty()) charts += "<div class=\"columns\">\n" + section + "</div>\n";
    }
  }
  if (num_charts <= kMostCharts) return charts;
  return charts + Paragraph(std::to_string(num_charts - kMostCharts) +
                            " further charts are not drawn; study.csv has their figures.");
}

// Returns charts of a study that varies nothing, one for each of its scenes: the errors beside the bound, for each pose
// or for each method of a hand-eye calibration.
std::string ConditionCharts(const std::vector<CellResult>& results) {
  std::vector<std::string> order;
  std::map<std::string, Json> data_of;
  std::map<std::string, const char*> kind_of;
  for (const CellResult& result : results) {
    if (!result.bound || result.methods.empty()) continue;
    const std::vector<StudyRow> rows = RowsOf(result);
    const bool is_pose = rows.front().IsPose();
    const std::string line = ConditionLine(result.labels);
    if (data_of.count(line) == 0) order.push_back(line);
    kind_of[line] = is_pose ? "translation" : "hand-eye translation";
    Json& data = data_of[line];
    data["unit"] = "mm";
    data["series"] = Json::array();
    Json of_pose{{"label", result.labels.pose}, {"values", Json::array()}};
    for (size_t i = 1; i < rows.size(); ++i) {
      const Json error_mm = OrNull(rows[i].errors.hand_eye_mm);
      data["series"].push_back(rows[i].name);
      of_pose["values"].push_back(error_mm);
      if (is_pose) continue;
      data["rows"].push_back(Json{{"label", rows[i].name},
                                  {"values", {error_mm, *rows[i].bound.hand_eye_mm}},
                                  {"strong", rows[i].is_emphasised}});
    }
    of_pose["values"].push_back(*rows.front().errors.hand_eye_mm);
    if (is_pose) data["rows"].push_back(of_pose);
    if (!is_pose) data["series"] = {"RMS error"};
    data["series"].push_back("bound");
  }
  std::string charts;
  for (const std::string& line : order) {
    charts += ViewFigure("dumbbells", line + ": RMS error of the " + kind_of[line] + " and its bound.", data_of[line]);
  }
  return charts.empty() ? "" : Heading("Errors and bounds") + charts;
}

// A column of the tables, and the results that have it.
struct PageColumn {
  enum class Of { kAll, kHandEye, kPose };
  Of of;
  const char* head;
  PageCell (*cell)(const StudyRow& row);
};

PageCell Number(const std::optional<double>& value) { return {value ? Significant(*value, 3) : "", true}; }
PageCell Count(const StudyRow& row, int MethodSummary::*count) {
  return {row.method == nullptr ? "" : std::to_string(row.method->*count), true};
}

using Row = StudyRow;
using Of = PageColumn::Of;
const PageColumn kColumns[] = {
    {Of::kAll, "pixel noise, px", [](const Row& row) { return Number(row.result->labels.pixel_sigma_px); }},
    {Of::kPose, "pose", [](const Row& row) { return PageCell{row.result->labels.pose}; }},
    {Of::kAll, "method",
     [](const Row& row) {
       return PageCell{row.name, false, {}, row.is_emphasised};
     }},
    {Of::kHandEye, "hand-eye, mm", [](const Row& row) { return Number(row.errors.hand_eye_mm); }},
    {Of::kPose, "error, mm", [](const Row& row) { return Number(row.errors.hand_eye_mm); }},
    {Of::kAll, "deg", [](const Row& row) { return Number(row.errors.hand_eye_deg); }},
    {Of::kAll, "mm / bound", [](const Row& row) { return Number(row.ByBound(&ShownErrors::hand_eye_mm)); }},
    {Of::kAll, "deg / bound", [](const Row& row) { return Number(row.ByBound(&ShownErrors::hand_eye_deg)); }},
    {Of::kHandEye, "board, mm", [](const Row& row) { return Number(row.errors.board_mm); }},
    {Of::kAll, "95 % coverage", [](const Row& row) { return Number(row.coverage); }},
    {Of::kPose, "gain, mm", [](const Row& row) { return Number(row.gain_mm); }},
    {Of::kPose, "gain, deg", [](const Row& row) { return Number(row.gain_deg); }},
    {Of::kHandEye, "AX-XB, mm", [](const Row& row) { return Number(row.axxb_mm); }},
    {Of::kAll, "failed", [](const Row& row) { return Count(row, &MethodSummary::num_failed); }},
    {Of::kAll, "trials", [](const Row& row) { return Count(row, &MethodSummary::num_trials); }}};

// Returns a table for each scene. The properties that its cells share are its heading.
std::string Tables(const std::vector<CellResult>& results) {
  std::vector<std::string> order;
  std::map<std::string, std::vector<StudyRow>> rows_of;
  for (const CellResult& result : results) {
    StudyLabels labels = result.labels;
    labels.pose.clear();
    const std::string scene = SceneLine(labels);
    if (rows_of.count(scene) == 0) order.push_back(scene);
    for (const StudyRow& row : RowsOf(result)) rows_of[scene].push_back(row);
  }
  std::string tables = Heading("All figures");
  for (const std::string& scene : order) {
    const std::vector<StudyRow>& rows = rows_of[scene];
    if (rows.empty()) continue;
    const StudyLabels& labels = rows.front().result->labels;
    // The pixel noise is part of the heading if all rows have the same.
    const bool has_one_noise = std::all_of(rows.begin(), rows.end(), [&](const StudyRow& row) {
      return row.result->labels.pixel_sigma_px == labels.pixel_sigma_px;
    });
    std::vector<std::string> head;
    std::vector<std::vector<PageCell>> cells(rows.size());
    for (const PageColumn& column : kColumns) {
      const bool is_shown = column.of == Of::kAll || (column.of == Of::kPose) == rows.front().IsPose();
      if (!is_shown || (has_one_noise && &column == kColumns)) continue;
      head.emplace_back(column.head);
      for (size_t i = 0; i < rows.size(); ++i) cells[i].push_back(column.cell(rows[i]));
    }
    const std::string heading = scene + (has_one_noise ? PixelNoiseText(labels) : "");
    const std::string table = HtmlTable(head, cells);
    constexpr size_t kFewScenes = 2;
    tables +=
        order.size() <= kFewScenes ? "<h3>" + EscapedForMarkup(heading) + "</h3>\n" + table : Details(heading, table);
  }
  return tables;
}

}  // namespace

std::string StudyPage(const std::string& title, const std::vector<CellResult>& results) {
  const std::string sweeps = SweepCharts(results);
  return HtmlPage(title,
                  "<h1>" + EscapedForMarkup(title) + "</h1>\n" +
                      Paragraph("RMS errors of every method, and the smallest error that any unbiased method can reach "
                                "(bound).") +
                      (sweeps.empty() ? ConditionCharts(results) : sweeps) + Tables(results),
                  PageWidth::kWide);
}

}  // namespace heba
