#include "tools/result_table.h"

#include <algorithm>
#include <cmath>

#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

std::string Cell(const std::optional<double>& value, int digits) {
  return value ? Significant(*value, digits) : std::string("-");
}

std::string PadLeft(const std::string& text, size_t width) {
  return text.size() < width ? std::string(width - text.size(), ' ') + text : text;
}
std::string PadRight(const std::string& text, size_t width) {
  return text.size() < width ? text + std::string(width - text.size(), ' ') : text;
}

double SigmaOf(const Covariance& covariance, Eigen::Index i) { return std::sqrt(covariance.matrix(i, i)); }

std::string Uncertainty(const Solution& solution) {
  std::vector<std::string> mm;
  std::vector<std::string> deg;
  for (Eigen::Index i = 0; i < 3; ++i) mm.push_back(Significant(1000 * SigmaOf(solution.covariance, i), 2));
  for (Eigen::Index i = 3; i < 6; ++i) deg.push_back(Significant(RadToDeg(SigmaOf(solution.covariance, i)), 2));
  return "one sigma " + Join(mm, ", ") + " mm; " + Join(deg, ", ") + " deg (camera's x, y, z)";
}

std::string PoseLine(const Rigid3d& pose) {
  const double sign = pose.rotation.w() < 0 ? -1 : 1;
  std::vector<std::string> t;
  std::vector<std::string> q;
  for (int i = 0; i < 3; ++i) t.push_back(Fixed(1000 * pose.translation[i], 3));
  for (int i = 0; i < 4; ++i) q.push_back(Fixed(sign * pose.rotation.coeffs()[i], 6));
  return "[" + Join(t, ", ") + "] mm, quaternion xyzw [" + Join(q, ", ") + "]";
}

}  // namespace

std::string ResultTable(const RunResult& result, Colour colour) {
  const bool ansi = colour == Colour::kAnsi;
  const std::string bold = ansi ? "\x1b[1m" : "";
  const std::string plain = ansi ? "\x1b[0m" : "";
  const auto used = std::count_if(result.captures.begin(), result.captures.end(),
                                  [](const CaptureResult& capture) { return capture.used; });
  const bool has_truth = std::any_of(result.estimates.begin(), result.estimates.end(),
                                     [](const Estimate& estimate) { return estimate.errors.truth.has_value(); });
  std::string table = bold + result.name + plain + ": " + std::string(SetupName(result.setup)) + ", " +
                      result.target_type + ", " + std::to_string(used) + " of " +
                      std::to_string(result.captures.size()) + " captures used\n\n";
  std::vector<std::string> header = {"in-sample", "hold-out", "AX-XB", "board mm", "deg"};
  if (has_truth) {
    header.emplace_back("true mm");
    header.emplace_back("deg");
  }
  constexpr size_t kMethodWidth = 13;
  constexpr size_t kWidth = 10;
  constexpr size_t kNarrow = 8;
  const auto width = [&](size_t i) { return i < 4 ? kWidth : kNarrow; };
  table += PadRight("method", kMethodWidth);
  for (size_t i = 0; i < header.size(); ++i) table += PadLeft(header[i], width(i));
  table += "\n" + PadRight("", kMethodWidth) + PadLeft("px rms", kWidth) + PadLeft("px rms", kWidth) +
           PadLeft("mm", kWidth) + PadLeft("rms", kWidth) + PadLeft("rms", kNarrow);
  if (has_truth) table += PadLeft("error", kNarrow) + PadLeft("error", kNarrow);
  table += "\n";
  for (const Estimate& estimate : result.estimates) {
    const bool refined = estimate.kind == "refined";
    if (refined) table += bold;
    table += PadRight(estimate.method, kMethodWidth);
    if (!estimate.ok) {
      table += "  failed: " + estimate.reason + plain + "\n";
      continue;
    }
    const Errors& errors = estimate.errors;
    std::vector<std::string> cells = {Cell(errors.reprojection_rms_px, 3), Cell(errors.holdout_rms_px, 3),
                                      Cell(errors.axxb_mean_mm, 3)};
    cells.push_back(errors.board_scatter ? Significant(errors.board_scatter->translation_rms_mm, 3) : "-");
    cells.push_back(errors.board_scatter ? Significant(errors.board_scatter->rotation_rms_deg, 2) : "-");
    if (has_truth) {
      cells.push_back(errors.truth ? Significant(errors.truth->hand_eye_mm, 3) : "-");
      cells.push_back(errors.truth ? Significant(errors.truth->hand_eye_deg, 2) : "-");
    }
    for (size_t i = 0; i < cells.size(); ++i) table += PadLeft(cells[i], width(i));
    if (refined) table += plain;
    table += "\n";
  }
  // The last of them is the refinement of the reprojection error.
  const auto refined = std::find_if(result.estimates.rbegin(), result.estimates.rend(),
                                    [](const Estimate& estimate) { return estimate.solution.has_value(); });
  if (refined == result.estimates.rend()) return table;
  table += "\n" + std::string(CameraMountName(result.setup)) + "_from_camera\n  " +
           PoseLine(refined->hand_eye.camera_mount_from_camera) + "\n  " + Uncertainty(*refined->solution) + "\n";
  table += "pixel noise " + Significant(refined->solution->pixel_sigma_px, 3) + " px a coordinate\n";
  for (const std::string& remark : refined->solution->remarks) table += "remark: " + remark + "\n";
  return table;
}

}  // namespace heba
