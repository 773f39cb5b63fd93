#include "tools/study/study_rows.h"

#include <algorithm>
#include <array>

#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

std::optional<double> Scaled(const std::optional<double>& value, double factor) {
  return value ? std::optional(factor * *value) : std::nullopt;
}

std::optional<double> Ratio(const std::optional<double>& value, const std::optional<double>& reference) {
  return value && reference && *reference > 0 ? std::optional(*value / *reference) : std::nullopt;
}

ShownErrors Shown(const StudyErrors& errors) {
  return {1000 * errors.hand_eye_m,
          RadToDeg(errors.hand_eye_rad),
          Scaled(errors.board_m, 1000),
          Scaled(errors.board_rad, RadToDeg(1.0)),
          errors.focal_px,
          Scaled(errors.inside_m, 1000),
          Scaled(errors.outside_m, 1000)};
}

}  // namespace

std::optional<double> StudyRow::ByBound(std::optional<double> ShownErrors::*error) const {
  return method == nullptr ? std::nullopt : Ratio(errors.*error, bound.*error);
}

std::vector<StudyRow> RowsOf(const CellResult& result) {
  std::vector<StudyRow> rows;
  const ShownErrors bound = result.bound ? Shown(*result.bound) : ShownErrors();
  if (result.bound) rows.push_back({&result, nullptr, "bound", false, bound, bound});
  const auto [jointly, one_by_one] = kStudyEstimatorNames;
  for (const MethodSummary& method : result.methods) {
    StudyRow& row = rows.emplace_back(StudyRow{&result, &method, method.method});
    row.is_emphasised = method.method == kBundleMethod || method.method == jointly;
    row.bound = bound;
    row.coverage = method.coverage;
    if (method.num_failed == method.num_trials) continue;
    row.errors = Shown(method.rms);
    if (!row.IsPose()) row.axxb_mm = method.axxb_mean_mm;
  }
  const auto row_of = [&](const char* name) {
    return std::find_if(rows.begin(), rows.end(), [&](const StudyRow& row) { return row.name == name; });
  };
  const auto joint = row_of(jointly);
  const auto single = row_of(one_by_one);
  if (joint != rows.end() && single != rows.end()) {
    joint->gain_mm = Ratio(single->errors.hand_eye_mm, joint->errors.hand_eye_mm);
    joint->gain_deg = Ratio(single->errors.hand_eye_deg, joint->errors.hand_eye_deg);
  }
  return rows;
}

const SweptQuantity kQuantities[kNumQuantities] = {
    {"pixel noise, px", false, [](const StudyLabels& l) { return l.pixel_sigma_px; }},
    {"captures", false, [](const StudyLabels& l) { return static_cast<double>(l.num_captures); }},
    {"points of the target", false, [](const StudyLabels& l) { return static_cast<double>(l.num_points); }},
    {"robot noise, mm", true, [](const StudyLabels& l) { return 1000 * l.robot_noise.translation_m; }},
    {"robot noise, deg", true, [](const StudyLabels& l) { return RadToDeg(l.robot_noise.rotation_rad); }},
    {"scale in x", true, [](const StudyLabels& l) { return l.shape_params[0]; }},
    {"scale in y", true, [](const StudyLabels& l) { return l.shape_params[1]; }},
    {"bend in x, mm", true, [](const StudyLabels& l) { return 1000 * l.shape_params[2]; }},
    {"bend in y, mm", true, [](const StudyLabels& l) { return 1000 * l.shape_params[3]; }},
    {"twist, mm", true, [](const StudyLabels& l) { return 1000 * l.shape_params[4]; }},
    {"cubic xxx, mm", true, [](const StudyLabels& l) { return 1000 * l.shape_params[5]; }},
    {"cubic xxy, mm", true, [](const StudyLabels& l) { return 1000 * l.shape_params[6]; }},
    {"cubic xyy, mm", true, [](const StudyLabels& l) { return 1000 * l.shape_params[7]; }},
    {"cubic yyy, mm", true, [](const StudyLabels& l) { return 1000 * l.shape_params[8]; }},
    {"outlier points, %", true, [](const StudyLabels& l) { return 100 * l.outlier_points; }},
    {"wrong poses, %", true, [](const StudyLabels& l) { return 100 * l.wrong_captures; }}};

bool IsSwept(size_t quantity, size_t swept) {
  const auto is_robot_noise = [](size_t of) { return of == kRobotMm || of == kRobotDeg; };
  return quantity == swept || (is_robot_noise(swept) && is_robot_noise(quantity));
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

std::string SceneLine(const StudyLabels& labels, size_t swept) {
  std::string line = labels.scene + " (" + SetupText(labels);
  if (!IsSwept(kCaptures, swept)) line += ", " + std::to_string(labels.num_captures) + " captures";
  if (!IsSwept(kPoints, swept)) line += ", " + std::to_string(labels.num_points) + " points";
  line += ")";
  if (!IsSwept(kRobotMm, swept) && (labels.robot_noise.translation_m > 0 || labels.robot_noise.rotation_rad > 0)) {
    line += ", robot " + Significant(1000 * labels.robot_noise.translation_m, 3) + " mm " +
            Significant(RadToDeg(labels.robot_noise.rotation_rad), 3) + " deg";
  }
  const std::array<double, TargetShape::kNumParams> designed = TargetShape().params;
  for (size_t i = 0; i < designed.size(); ++i) {
    if (labels.shape_params[i] == designed[i] || IsSwept(kScaleX + i, swept)) continue;
    constexpr std::array<const char*, TargetShape::kNumParams> kWords = {
        "x scale", "y scale", "x bend", "y bend", "twist", "cubic xxx", "cubic xxy", "cubic xyy", "cubic yyy"};
    line += std::string(", ") + kWords[i] + " " +
            (i < 2 ? Fixed(labels.shape_params[i], 4) : Significant(1000 * labels.shape_params[i], 3) + " mm");
  }
  line += ", refined with robot " + labels.robot_model;
  if (!labels.free_intrinsics.empty()) line += ", intrinsics " + IntrinsicsText(labels);
  if (!labels.kinematics.empty()) line += ", kinematics " + labels.kinematics;
  if (labels.outlier_points > 0 && !IsSwept(kOutlierPoints, swept)) {
    line += ", " + Significant(100 * labels.outlier_points, 3) + " % outlier points";
  }
  if (labels.wrong_captures > 0 && !IsSwept(kWrongPoses, swept)) {
    line += ", " + Significant(100 * labels.wrong_captures, 3) + " % wrong poses";
  }
  if (!labels.pose.empty()) line += ": " + labels.pose;
  return line;
}

std::string PixelNoiseText(const StudyLabels& labels) {
  return ", pixel noise " + Significant(labels.pixel_sigma_px, 3) + " px";
}

std::string ConditionLine(StudyLabels labels) {
  labels.pose.clear();
  return SceneLine(labels) + PixelNoiseText(labels);
}

}  // namespace heba
