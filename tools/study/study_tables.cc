#include "tools/study/study_tables.h"

#include <utility>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/text/failure_text.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

// A column of the terminal's table. `group` stands right-aligned above the column and those before it that it names.
struct TextColumn {
  const char* group;
  size_t group_width;
  const char* head;
  size_t width;
  std::optional<double> (*figure)(const StudyRow& row);
  bool is_share = false;     // Shares have three decimals.
  bool is_optional = false;  // Without a figure the row ends; otherwise it has a dash.
};

using Row = StudyRow;
const std::vector<TextColumn> kHandEyeColumns = {
    {"", 0, "mm", 9, [](const Row& row) { return row.errors.hand_eye_mm; }},
    {"hand-eye", 18, "deg", 9, [](const Row& row) { return row.errors.hand_eye_deg; }},
    {"", 0, "mm", 9, [](const Row& row) { return row.errors.board_mm; }},
    {"board", 18, "deg", 9, [](const Row& row) { return row.errors.board_deg; }},
    {"", 0, "mm", 6, [](const Row& row) { return row.ByBound(&ShownErrors::hand_eye_mm); }},
    {"", 0, "deg", 6, [](const Row& row) { return row.ByBound(&ShownErrors::hand_eye_deg); }},
    {"error / bound", 18, "focal", 6, [](const Row& row) { return row.ByBound(&ShownErrors::focal_px); }},
    {"95 %", 6, "holds", 6, [](const Row& row) { return row.coverage; }, true},
    {"AX-XB", 7, "mm", 7, [](const Row& row) { return row.axxb_mm; }}};
const std::vector<TextColumn> kPoseColumns = {
    {"", 0, "mm", 12, [](const Row& row) { return row.errors.hand_eye_mm; }},
    {"error", 23, "deg", 11, [](const Row& row) { return row.errors.hand_eye_deg; }},
    {"", 0, "mm", 9, [](const Row& row) { return row.ByBound(&ShownErrors::hand_eye_mm); }},
    {"error / bound", 17, "deg", 8, [](const Row& row) { return row.ByBound(&ShownErrors::hand_eye_deg); }},
    {"95 %", 9, "holds", 9, [](const Row& row) { return row.coverage; }, true},
    {"", 0, "mm", 8, [](const Row& row) { return row.gain_mm; }, false, true},
    {"gain", 16, "deg", 8, [](const Row& row) { return row.gain_deg; }, false, true}};

// Returns both lines of the headings; the names of the rows take `margin` characters.
std::string HeadLines(const std::vector<TextColumn>& columns, size_t margin) {
  std::string groups = PadRight("", margin);
  std::string heads = groups;
  for (const TextColumn& column : columns) {
    groups += PadLeft(column.group, column.group_width);
    heads += PadLeft(column.head, column.width);
  }
  return groups + "\n" + heads + "\n";
}

// Returns the figures of a row; that of the bound has errors alone, and that of a method that always failed none.
std::string RowLine(const std::vector<TextColumn>& columns, const StudyRow& row) {
  std::string line;
  if (!row.errors.hand_eye_mm) return line;
  for (const TextColumn& column : columns) {
    const std::optional<double> figure = column.figure(row);
    if (!figure && (column.is_optional || row.method == nullptr)) break;
    line += PadLeft(!figure ? "-" : column.is_share ? Fixed(*figure, 3) : Significant(*figure, 3), column.width);
  }
  return line;
}

// Returns what stands below the row of a method, each line after `margin` blanks.
std::string LinesBelow(const StudyRow& row, size_t margin) {
  if (row.method == nullptr) return "";
  const MethodSummary& method = *row.method;
  std::vector<std::string> lines;
  if (method.num_failed > 0) {
    lines.push_back("failed in " + std::to_string(method.num_failed) + " of " + std::to_string(method.num_trials) +
                    " trials");
  }
  if (method.right_model) {
    lines.push_back("correct error model chosen: " + Significant(100 * *method.right_model, 3) + " %");
  }
  if (method.estimated_effects) {
    lines.push_back("errors of the arm estimated: " + Significant(100 * *method.estimated_effects, 3) + " %");
  }
  const auto add_place = [&](const char* where, std::optional<double> ShownErrors::*error,
                             const std::optional<double>& coverage) {
    if (!(row.errors.*error) || !(row.bound.*error)) return;
    const std::optional<double> by_bound = row.ByBound(error);
    lines.push_back(std::string("target predicted ") + where + ": " + Significant(*(row.errors.*error), 3) + " mm, " +
                    (by_bound ? Significant(*by_bound, 3) : "-") + " x bound, 95 % holds " +
                    Fixed(coverage.value_or(0), 3));
  };
  add_place("in captured configurations", &ShownErrors::inside_mm, method.coverage_inside);
  add_place("in other configurations", &ShownErrors::outside_mm, method.coverage_outside);
  if (method.robot_noise) {
    lines.push_back("estimated (median): pixel noise " + Significant(method.pixel_sigma_px.value_or(0), 3) +
                    " px, robot " + ShownNoise(1000 * method.robot_noise->translation_m) + " mm " +
                    ShownNoise(RadToDeg(method.robot_noise->rotation_rad)) + " deg");
  }
  std::string text;
  for (const std::string& line : lines) text += PadRight("", margin) + line + "\n";
  return text;
}

std::string Csv(const std::optional<double>& value) { return value ? Significant(*value, 8) : ""; }

// Returns the columns of study.csv with their values in the row of a method.
std::vector<std::pair<const char*, std::string>> CsvFields(const StudyRow& row) {
  const StudyLabels& labels = row.result->labels;
  const MethodSummary& method = *row.method;
  const RobotNoise found = method.robot_noise.value_or(RobotNoise());
  const auto if_found = [&](double value) { return method.robot_noise ? Csv(value) : ""; };
  return {{"cell", std::to_string(row.result->cell)},
          {"scene", CsvField(labels.scene)},
          {"setup", labels.rig.empty() ? SetupText(labels) : "rig"},
          {"captures", std::to_string(labels.num_captures)},
          {"points", std::to_string(labels.num_points)},
          {"pixel_noise_px", Csv(labels.pixel_sigma_px)},
          {"robot_translation_mm", Csv(1000 * labels.robot_noise.translation_m)},
          {"robot_rotation_deg", Csv(RadToDeg(labels.robot_noise.rotation_rad))},
          {"scale_x", Csv(labels.shape_params[0])},
          {"scale_y", Csv(labels.shape_params[1])},
          {"bend_x_mm", Csv(1000 * labels.shape_params[2])},
          {"bend_y_mm", Csv(1000 * labels.shape_params[3])},
          {"twist_mm", Csv(1000 * labels.shape_params[4])},
          {"outlier_points", Csv(labels.outlier_points)},
          {"wrong_captures", Csv(labels.wrong_captures)},
          {"robot_model", labels.robot_model},
          {"method", row.name},
          {"trials", std::to_string(method.num_trials)},
          {"failed", std::to_string(method.num_failed)},
          {"hand_eye_mm", Csv(row.errors.hand_eye_mm)},
          {"hand_eye_deg", Csv(row.errors.hand_eye_deg)},
          {"board_mm", Csv(row.errors.board_mm)},
          {"board_deg", Csv(row.errors.board_deg)},
          {"focal_px", Csv(row.errors.focal_px)},
          {"bound_hand_eye_mm", Csv(row.bound.hand_eye_mm)},
          {"bound_hand_eye_deg", Csv(row.bound.hand_eye_deg)},
          {"bound_board_mm", Csv(row.bound.board_mm)},
          {"bound_board_deg", Csv(row.bound.board_deg)},
          {"bound_focal_px", Csv(row.bound.focal_px)},
          {"coverage_95", Csv(row.coverage)},
          {"right_model", Csv(method.right_model)},
          {"axxb_mean_mm", Csv(row.axxb_mm)},
          {"found_pixel_sigma_px", Csv(method.pixel_sigma_px)},
          {"found_robot_mm", if_found(1000 * found.translation_m)},
          {"found_robot_deg", if_found(RadToDeg(found.rotation_rad))},
          {"kinematics", labels.kinematics},
          {"estimated_effects", Csv(method.estimated_effects)},
          {"inside_mm", Csv(row.errors.inside_mm)},
          {"bound_inside_mm", Csv(row.bound.inside_mm)},
          {"coverage_inside", Csv(method.coverage_inside)},
          {"outside_mm", Csv(row.errors.outside_mm)},
          {"bound_outside_mm", Csv(row.bound.outside_mm)},
          {"coverage_outside", Csv(method.coverage_outside)},
          {"pose", CsvField(row.IsPose() ? labels.pose : "hand_eye")},
          {"intrinsics", IntrinsicsText(labels)},
          {"gain_mm", Csv(row.gain_mm)},
          {"gain_deg", Csv(row.gain_deg)}};
}

}  // namespace

std::string StudyTable(const std::vector<CellResult>& results) {
  std::string table;
  for (size_t i = 0; i < results.size(); ++i) {
    const CellResult& result = results[i];
    const bool is_first = i == 0 || results[i - 1].cell != result.cell;
    const bool is_last = i + 1 == results.size() || results[i + 1].cell != result.cell;
    if (is_first) table += ConditionLine(result.labels) + "\n";
    if (!result.bound) {
      if (is_first) table += "  no bound: " + FailureText(result.bound.failure()) + "\n\n";
      continue;
    }
    const bool is_pose = !result.labels.pose.empty();
    const std::vector<TextColumn>& columns = is_pose ? kPoseColumns : kHandEyeColumns;
    const size_t indent = is_pose ? 4 : 2;
    constexpr size_t kName = 11;
    if (is_first) table += HeadLines(columns, indent + kName);
    if (is_pose) table += "  " + result.labels.pose + "\n";
    for (const StudyRow& row : RowsOf(result)) {
      table += PadRight("", indent) + PadRight(row.name, kName) + RowLine(columns, row) + "\n" + LinesBelow(row, 15);
    }
    table += is_last ? "\n" : "";
  }
  return table;
}

std::string StudyCsv(const std::vector<CellResult>& results) {
  const CellResult no_result;
  const MethodSummary no_method;
  std::vector<std::string> names;
  for (const auto& [name, text] : CsvFields({&no_result, &no_method})) names.emplace_back(name);
  std::string csv = Join(names, ",") + "\n";
  for (const CellResult& result : results) {
    for (const StudyRow& row : RowsOf(result)) {
      if (row.method == nullptr) continue;
      std::vector<std::string> texts;
      for (const auto& [name, text] : CsvFields(row)) texts.push_back(text);
      csv += Join(texts, ",") + "\n";
    }
  }
  return csv;
}

}  // namespace heba
