#include "tools/text/result_table.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

double SigmaAt(const Covariance& covariance, Eigen::Index i) { return std::sqrt(covariance.matrix(i, i)); }

std::string Uncertainty(const Solution& solution) {
  std::vector<std::string> mm;
  std::vector<std::string> deg;
  for (Eigen::Index i = 0; i < 3; ++i) mm.push_back(ShownAmount(1000 * SigmaAt(solution.covariance, i), 2));
  for (Eigen::Index i = 3; i < 6; ++i) deg.push_back(ShownAmount(RadToDeg(SigmaAt(solution.covariance, i)), 2));
  return "one sigma " + Join(mm, ", ") + " mm; " + Join(deg, ", ") + " deg (camera's x, y, z)";
}

// Describes the target's shape; empty if it was not estimated.
std::string ShapeLine(const Solution& solution) {
  std::vector<std::string> parts;
  for (size_t i = 0; i < solution.shape.params.size(); ++i) {
    const std::optional<double> sigma =
        SigmaOf(solution.covariance, "target." + std::string(kTargetShapeParamNames[i]));
    if (!sigma) continue;
    const bool is_scale = i < 2;
    parts.push_back(std::string(is_scale ? "scale" : "bend") + (i % 2 == 0 ? " x " : " y ") +
                    Fixed((is_scale ? 1 : 1000) * solution.shape.params[i], is_scale ? 5 : 3) +
                    (is_scale ? "" : " mm") + " (one sigma " + ShownAmount((is_scale ? 1 : 1000) * *sigma, 2) + ")");
  }
  return parts.empty() ? "" : "target: " + Join(parts, ", ") + "\n";
}

std::string NoiseLine(const Solution& solution, const std::optional<double>& holdout_chi2) {
  std::string line = "pixel noise " + Significant(solution.pixel_sigma_px, 3) + " px per coordinate";
  if (solution.robot_noise) {
    line += ", robot noise " + RobotNoiseText(solution);
  }
  if (holdout_chi2) line += "; hold-out chi-square " + Significant(*holdout_chi2, 3) + " per degree of freedom";
  return line + "\n";
}

}  // namespace

std::string ResultTable(const RunResult& result, Colour colour, const std::vector<std::string>& asked_for) {
  const bool ansi = colour == Colour::kAnsi;
  const std::string bold = ansi ? "\x1b[1m" : "";
  const std::string plain = ansi ? "\x1b[0m" : "";
  const auto used = std::count_if(result.captures.begin(), result.captures.end(),
                                  [](const CaptureResult& capture) { return capture.used; });
  const bool has_truth = std::any_of(result.estimates.begin(), result.estimates.end(),
                                     [](const Estimate& estimate) { return estimate.errors.truth.has_value(); });
  std::string table = bold + result.name + plain + ": " + std::string(SetupName(result.setup)) + ", " +
                      result.target_type + ", " + std::to_string(used) + " of " +
                      std::to_string(result.captures.size()) + " captures used\n" +
                      VerdictLines(result.verdict, colour) + "\n";
  // Title, unit and figure of each column; the table is 80 characters wide.
  struct Column {
    const char* title;
    const char* unit;
    size_t width;
    int digits;
    std::function<std::optional<double>(const Errors&)> figure;
  };
  std::vector<Column> columns = {
      {"in-sample", "px rms", 9, 3, [](const Errors& errors) { return errors.reprojection_rms_px; }},
      {"hold-out", "px rms", 9, 3, [](const Errors& errors) { return errors.holdout_rms_px; }},
      {"hold-out", "mm rms", 9, 3, [](const Errors& errors) { return errors.holdout_target_mm; }},
      {"", "deg", 8, 2, [](const Errors& errors) { return errors.holdout_target_deg; }},
      {"AX-XB", "mm", 8, 3, [](const Errors& errors) { return errors.axxb_mean_mm; }},
      {"board", "mm rms", 9, 3, [](const Errors& errors) {
         return errors.board_scatter ? std::optional<double>(errors.board_scatter->translation_rms_mm) : std::nullopt;
       }}};
  if (has_truth) {
    columns.push_back({"true err", "mm", 9, 3, [](const Errors& errors) {
                         return errors.truth ? std::optional<double>(errors.truth->hand_eye_mm) : std::nullopt;
                       }});
    columns.push_back({"", "deg", 8, 2, [](const Errors& errors) {
                         return errors.truth ? std::optional<double>(errors.truth->hand_eye_deg) : std::nullopt;
                       }});
  }
  constexpr size_t kMethodWidth = 11;
  table += PadRight("method", kMethodWidth);
  for (const Column& column : columns) table += PadLeft(column.title, column.width);
  table += "\n" + PadRight("", kMethodWidth);
  for (const Column& column : columns) table += PadLeft(column.unit, column.width);
  table += "\n";
  for (const Estimate& estimate : result.estimates) {
    const bool is_last = &estimate == &result.estimates.back();
    if (!estimate.ok) continue;
    if (is_last) table += bold;
    table += PadRight(estimate.method, kMethodWidth);
    for (const Column& column : columns) {
      table += PadLeft(FigureCell(column.figure(estimate.errors), column.digits, column.width), column.width);
    }
    if (is_last) table += plain;
    table += "\n";
  }
  for (const auto& [reason, methods] : MethodsWithoutResult(result, asked_for))
    table += methods + ": no result, " + reason + "\n";
  // The refinement of the reprojection error.
  const Estimate* refined = FindRefined(result);
  if (refined == nullptr) {
    // There is none in a result from poses alone.
    for (const Estimate& estimate : result.estimates) {
      if (!estimate.ok || estimate.kind != EstimateKind::kRefined) continue;
      table += "\n" + std::string(CameraMountName(result.setup)) + "_from_camera (" + estimate.method + ")\n  " +
               HandEyePoseText(estimate) + "\n";
    }
    return table;
  }
  table += "\n" + std::string(CameraMountName(result.setup)) + "_from_camera\n  " + HandEyePoseText(*refined) + "\n  " +
           Uncertainty(*refined->solution) + "\n";
  table += NoiseLine(*refined->solution, refined->errors.holdout_chi2);
  table += ShapeLine(*refined->solution);
  for (const Finding& finding : result.verdict.findings) {
    if (finding.code == "model") table += finding.text + "\n";
    if (finding.code == "camera") table += "camera: " + finding.text + "\n";
    const bool is_of_arm = std::string_view(finding.code).starts_with("arm_");
    if (finding.code == "smooth_errors") table += "robot: " + finding.text + "\n";
    if (is_of_arm) table += "arm: " + finding.text + (finding.action.empty() ? "" : "; " + finding.action) + "\n";
  }
  return table;
}

}  // namespace heba
