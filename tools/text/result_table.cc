#include "tools/text/result_table.h"

#include <algorithm>
#include <cmath>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/hand_eye.h"
#include "heba/kernels/small_matrix.h"
#include "tools/text/camera_figures.h"
#include "tools/text/figure_columns.h"

namespace heba {
namespace {

// Words the covariance of a pose.
using SigmasText = std::string (*)(const Matrix6&);
using Columns = std::vector<FigureColumn<CameraFigures>>;

// The width of the names of methods and of cameras.
constexpr size_t kMethodWidth = 11;
constexpr size_t kCameraWidth = 14;

std::string Strong(const std::string& text, Colour colour) {
  return colour == Colour::kAnsi ? "\x1b[1m" + text + "\x1b[0m" : text;
}

std::string Title(const std::string& name, const std::string& facts, const Verdict& verdict, Colour colour) {
  return Strong(name, colour) + ": " + facts + "\n" + VerdictLines(verdict, colour) + "\n";
}

std::string ShortName(const std::string& name) {
  return name.size() >= kCameraWidth ? name.substr(0, kCameraWidth - 3) + ".. " : PadRight(name, kCameraWidth);
}

// A line of a table of figures: what stands before them, padded.
struct LineOfFigures {
  std::string begin;
  CameraFigures figures;
  bool is_strong = false;
};

// Returns the table of the lines. The columns `of_truth` are the last ones if a true error is known.
std::string FigureTable(const std::string& begin, const std::string& below, Columns columns, const Columns& of_truth,
                        const std::vector<LineOfFigures>& lines, Colour colour) {
  const bool has_truth = std::any_of(lines.begin(), lines.end(),
                                     [](const LineOfFigures& line) { return line.figures.truth_mm.has_value(); });
  if (has_truth) columns.insert(columns.end(), of_truth.begin(), of_truth.end());
  std::string table = ColumnHeads(begin, below, columns);
  for (const LineOfFigures& line : lines) {
    const std::string text = line.begin + FigureCells(columns, line.figures);
    table += (line.is_strong ? Strong(text, colour) : text) + "\n";
  }
  return table;
}

std::string MethodsTable(const RunResult& result, Colour colour, const std::vector<std::string>& asked_for) {
  const Columns columns = {{"in-sample", "px rms", 9, 3, &CameraFigures::reprojection_rms_px},
                           {"hold-out", "px rms", 9, 3, &CameraFigures::holdout_rms_px},
                           {"hold-out", "mm rms", 9, 3, &CameraFigures::holdout_target_mm},
                           {"", "deg", 8, 2, &CameraFigures::holdout_target_deg},
                           {"AX-XB", "mm", 8, 3, &CameraFigures::axxb_mean_mm},
                           {"board", "mm rms", 9, 3, &CameraFigures::board_mm}};
  const Columns of_truth = {{"true err", "mm", 9, 3, &CameraFigures::truth_mm},
                            {"", "deg", 8, 2, &CameraFigures::truth_deg}};
  std::vector<LineOfFigures> lines;
  for (const Estimate& estimate : result.estimates) {
    if (!estimate.ok) continue;
    lines.push_back(
        {PadRight(estimate.method, kMethodWidth), FiguresOf(&estimate), &estimate == &result.estimates.back()});
  }
  std::string table =
      FigureTable(PadRight("method", kMethodWidth), PadRight("", kMethodWidth), columns, of_truth, lines, colour);
  for (const auto& [reason, methods] : MethodsWithoutResult(result, asked_for)) {
    table += methods + ": no result, " + reason + "\n";
  }
  return table;
}

std::string CamerasTable(const RunResult& result, Colour colour) {
  constexpr size_t kImagesWidth = 9;
  const Columns columns = {{"in-sample", "px rms", 11, 3, &CameraFigures::reprojection_rms_px},
                           {"hold-out", "px rms", 10, 3, &CameraFigures::holdout_rms_px},
                           {"hold-out", "mm rms", 10, 3, &CameraFigures::holdout_target_mm},
                           {"", "deg", 8, 2, &CameraFigures::holdout_target_deg},
                           {"noise", "px", 9, 3, &CameraFigures::pixel_sigma_px}};
  const Columns of_truth = {{"true err", "mm", 9, 3, &CameraFigures::truth_mm}};
  std::vector<LineOfFigures> lines;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const std::string& name = result.rig.cameras[c].name;
    const auto [used, all] = CountImages(result, name);
    lines.push_back({ShortName(name) + PadLeft(std::to_string(used) + "/" + std::to_string(all), kImagesWidth),
                     FiguresOf(result, c)});
  }
  return FigureTable(PadRight("camera", kCameraWidth) + PadLeft("images", kImagesWidth),
                     PadRight("", kCameraWidth) + PadLeft("used", kImagesWidth), columns, of_truth, lines, colour);
}

std::string LargestSigmasText(const Matrix6& covariance) {
  const auto [sigma_m, sigma_rad] = LargestSigmas(covariance);
  return "one sigma " + ShownAmount(1000 * sigma_m, 2) + " mm, " + ShownAmount(RadToDeg(sigma_rad), 2) +
         " deg (least certain axis)";
}

std::string SigmasOfAxesText(const Matrix6& covariance) {
  std::vector<std::string> mm;
  std::vector<std::string> deg;
  for (Eigen::Index i = 0; i < 3; ++i) mm.push_back(ShownAmount(1000 * std::sqrt(covariance(i, i)), 2));
  for (Eigen::Index i = 3; i < 6; ++i) deg.push_back(ShownAmount(RadToDeg(std::sqrt(covariance(i, i))), 2));
  return "one sigma " + Join(mm, ", ") + " mm; " + Join(deg, ", ") + " deg (camera's x, y, z)";
}

// Returns the lines of a pose of the result. `sigmas` words its covariance; null leaves this line out.
std::string PoseLines(const std::string& title, const Rigid3d& pose, const std::optional<Matrix6>& covariance,
                      const std::optional<PoseError>& truth = std::nullopt, SigmasText sigmas = &LargestSigmasText) {
  if (!covariance) return title + "\n  " + PoseText(pose) + "\n";
  const auto [sigma_m, sigma_rad] = LargestSigmas(*covariance);
  std::string lines = title + "\n  " + PoseText(pose, 1000 * sigma_m, sigma_rad) + "\n";
  if (sigmas != nullptr) lines += "  " + sigmas(*covariance) + "\n";
  if (!truth) return lines;
  return lines + "  true error " + ShownAmount(truth->mm, 2) + " mm, " + ShownAmount(truth->deg, 2) + " deg\n";
}

// Returns the line of a camera's focal lengths and principal point. The distortion is in the report and in result.json.
std::string IntrinsicsLine(const ProblemCamera& camera, const Camera& intrinsics, const Covariance& covariance) {
  constexpr size_t kFocalAndCentre = 4;
  const std::vector<std::string>& names = intrinsics.Model().param_names();
  const size_t count = std::min(kFocalAndCentre, names.size());
  std::optional<double> largest;
  for (size_t i = 0; i < count; ++i) {
    largest = std::max(largest, SigmaOf(covariance, CameraBlock(camera) + "." + names[i]));
  }
  std::vector<std::string> parts;
  for (size_t i = 0; i < count; ++i) {
    const double value = intrinsics.params[i];
    parts.push_back(names[i] + " " + (largest ? Fixed(value, DecimalsFor(*largest, 6)) : Significant(value, 7)));
  }
  return "  intrinsics " + intrinsics.model + ": " + Join(parts, ", ") + " px" +
         (largest ? " (one sigma up to " + ShownAmount(*largest, 2) + ")" : " (held)") + "\n";
}

// Returns the lines of the poses of cameras, targets and arms, and of those between cameras.
std::string PosesText(const RunResult& result) {
  const Problem& rig = result.rig;
  const CellPoses& poses = result.solution.poses;
  const Covariance& covariance = result.solution.covariance;
  std::string text;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    text += PoseLines("camera " + rig.cameras[c].name + " in " + MountText(rig, rig.cameras[c]),
                      poses.mount_from_camera[c], PoseCovarianceOf(covariance, CameraPoseBlock(rig.cameras[c]))) +
            IntrinsicsLine(rig.cameras[c], result.solution.cameras[c], covariance);
  }
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    text +=
        PoseLines("target " + rig.targets[t].name + " in " + MountText(rig, rig.targets[t]), poses.mount_from_target[t],
                  PoseCovarianceOf(covariance, TargetPoseBlock(rig.targets[t])), ErrorAt(result.truth.targets, t));
  }
  for (size_t r = 1; r < rig.robots.size(); ++r) {
    text += PoseLines("base of arm " + rig.robots[r] + " in world", poses.world_from_base[r],
                      PoseCovarianceOf(covariance, BaseBlock(rig.robots[r])), ErrorAt(result.truth.bases, r));
  }
  for (size_t i = 0; i < result.relative_cameras.size(); ++i) {
    const RelativePose& pose = result.relative_cameras[i];
    text += PoseLines("camera " + pose.child + " in camera " + pose.parent, pose.parent_from_child, pose.covariance,
                      ErrorAt(result.truth.relative_cameras, i));
  }
  return text;
}

constexpr std::array<std::string_view, TargetShape::kNumParams> kTargetShapeWords = {
    "scale x", "scale y", "bend x", "bend y", "twist", "cubic xxx", "cubic xxy", "cubic xyy", "cubic yyy"};

// Describes the target's shape; empty if it was not estimated.
std::string ShapeLine(const ProblemTarget& target, const TargetShape& shape, const Covariance& covariance) {
  std::vector<std::string> parts;
  for (size_t i = 0; i < TargetShape::kNumParams; ++i) {
    const std::optional<double> sigma =
        SigmaOf(covariance, TargetShapeBlock(target) + "." + std::string(kTargetShapeParamNames[i]));
    if (!sigma) continue;
    const bool is_scale = ShapeGroupOf(static_cast<int>(i)) == TargetShapeGroup::kScale;
    const double unit = is_scale ? 1 : 1000;
    parts.push_back(std::string(kTargetShapeWords[i]) + " " + Fixed(unit * shape.params[i], is_scale ? 5 : 3) +
                    (is_scale ? "" : " mm") + " (one sigma " + ShownAmount(unit * *sigma, 2) + ")");
  }
  if (parts.empty()) return "";
  return (target.name.empty() ? "target" : "target " + target.name) + ": " + Join(parts, ", ") + "\n";
}

std::string ChiSquareText(const std::optional<double>& holdout_chi2) {
  return holdout_chi2 ? "hold-out chi-square " + Significant(*holdout_chi2, 3) + " per degree of freedom" : "";
}

// Returns the lines of the findings that describe the model, the camera and the arm. `of_arm`: the arm that they
// concern; nothing for those of no named arm.
std::string FindingLines(const Verdict& verdict, const std::optional<std::string>& of_arm) {
  constexpr std::pair<std::string_view, const char*> kSubjects[] = {
      {"model", ""}, {"camera", "camera: "}, {"smooth_errors", "robot: "}, {"arm_", "arm: "}, {"time_offset", ""}};
  std::string lines;
  for (const Finding& finding : verdict.findings) {
    if (finding.Name("of_arm") != of_arm) continue;
    // The findings of a named arm begin with its name.
    const char* subject = of_arm ? "" : nullptr;
    for (const auto& [code, text] : kSubjects) {
      const bool is_meant = code.ends_with('_') ? finding.code.starts_with(code) : finding.code == code;
      if (!of_arm && is_meant) subject = text;
    }
    if (subject == nullptr) continue;
    lines += subject + finding.text + (finding.action.empty() ? "" : "; " + finding.action) + "\n";
  }
  return lines;
}

// Returns the lines of the noise, the shape and the findings of a rig.
std::string ModelLines(const RunResult& result) {
  const Solution& solution = result.solution;
  std::string lines;
  for (size_t r = 0; r < result.rig.robots.size(); ++r) {
    if (solution.robot_noise[r]) {
      lines += "arm " + result.rig.robots[r] + ": noise " +
               RobotNoiseText(*solution.robot_noise[r], SmoothNoiseOf(solution, r)) + "\n";
    }
    lines += FindingLines(result.verdict, result.rig.robots[r]);
  }
  if (result.holdout_chi2) lines += ChiSquareText(result.holdout_chi2) + "\n";
  for (size_t t = 0; t < result.rig.targets.size(); ++t) {
    lines += ShapeLine(result.rig.targets[t], solution.shapes[t], solution.covariance);
  }
  return lines + FindingLines(result.verdict, std::nullopt);
}

// The same of a single camera, whose pixel noise has no column.
std::string ModelLinesOfPair(const RunResult& result) {
  const Solution& solution = result.solution;
  std::string line = "pixel noise " + Significant(solution.pixel_sigmas_px[0], 3) + " px per coordinate";
  if (solution.robot_noise[0]) {
    line += ", robot noise " + RobotNoiseText(*solution.robot_noise[0], SmoothNoiseOf(solution, 0));
  }
  if (result.holdout_chi2) line += "; " + ChiSquareText(result.holdout_chi2);
  return line + "\n" + ShapeLine({}, solution.shapes[0], solution.covariance) +
         FindingLines(result.verdict, std::nullopt);
}

std::string TableOfMethods(const RunResult& result, Colour colour, const std::vector<std::string>& asked_for) {
  const Setup setup = SetupOf(result.rig.cameras[0].mount);
  const std::string& target = result.target_types[0];
  const std::string table =
      Title(result.name,
            std::string(SetupName(setup)) + ", " + (target.empty() ? "poses of the target" : target) + ", " +
                std::to_string(NumUsedCaptures(result)) + " of " + std::to_string(NumCaptures(result)) +
                " captures used",
            result.verdict, colour) +
      MethodsTable(result, colour, asked_for);
  const auto pose_lines = [&](const std::string& title, const Estimate& estimate, SigmasText sigmas) {
    return PoseLines("\n" + std::string(CameraMountName(setup)) + "_from_camera" + title,
                     estimate.hand_eye.camera_mount_from_camera,
                     estimate.solution ? PoseCovarianceOf(estimate.solution->covariance, kHandEyeBlock) : std::nullopt,
                     std::nullopt, sigmas);
  };
  // The refinement of the reprojection error.
  if (const Estimate* const refined = FindRefined(result)) {
    return table + pose_lines("", *refined, &SigmasOfAxesText) + ModelLinesOfPair(result);
  }
  // There is none in a result from poses alone.
  const Estimate* const found = FindFinal(result);
  if (found == nullptr) return table;
  return table + pose_lines(" (" + found->method + ")", *found, nullptr) + FindingLines(result.verdict, std::nullopt);
}

}  // namespace

std::string ResultTable(const RunResult& result, Colour colour, const std::vector<std::string>& asked_for) {
  if (IsShort(result)) return TableOfMethods(result, colour, asked_for);
  const auto count = [](size_t number, const std::string& what) {
    return std::to_string(number) + " " + what + (number == 1 ? "" : "s");
  };
  return Title(result.name,
               count(result.rig.cameras.size(), "camera") + ", " + count(result.rig.targets.size(), "target") + ", " +
                   count(result.rig.robots.size(), "arm"),
               result.verdict, colour) +
         CamerasTable(result, colour) + "\n" + PosesText(result) + ModelLines(result);
}

}  // namespace heba
