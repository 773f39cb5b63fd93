#include "tools/text/rig_table.h"

#include <algorithm>
#include <cmath>

#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

constexpr size_t kNameWidth = 14;

std::string ShortName(const std::string& name) {
  return name.size() >= kNameWidth ? name.substr(0, kNameWidth - 3) + ".. " : PadRight(name, kNameWidth);
}

std::string SigmaText(const Eigen::Matrix<double, 6, 6>& covariance) {
  const auto [sigma_m, sigma_rad] = LargestSigmas(covariance);
  return "one sigma " + ShownAmount(1000 * sigma_m, 2) + " mm, " + ShownAmount(RadToDeg(sigma_rad), 2) +
         " deg (least certain axis)";
}

// Returns the lines of a pose of the result.
std::string PoseLines(const std::string& title, const Rigid3d& pose, const Eigen::Matrix<double, 6, 6>& covariance,
                      const std::optional<PoseError>& truth = std::nullopt) {
  const auto [sigma_m, sigma_rad] = LargestSigmas(covariance);
  const std::string lines =
      title + "\n  " + PoseText(pose, 1000 * sigma_m, sigma_rad) + "\n  " + SigmaText(covariance) + "\n";
  if (!truth) return lines;
  return lines + "  true error " + ShownAmount(truth->mm, 2) + " mm, " + ShownAmount(truth->deg, 2) + " deg\n";
}

// Returns the line of a camera's focal lengths and principal point. The distortion is in the report and in result.json.
std::string IntrinsicsLine(const RigCamera& camera, const Camera& intrinsics, const Covariance& covariance) {
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

std::string CamerasTable(const RigResult& result) {
  const bool has_truth = std::any_of(result.errors.begin(), result.errors.end(),
                                     [](const RigErrors& errors) { return errors.truth_mm.has_value(); });
  std::string table = PadRight("camera", kNameWidth) + PadLeft("images", 9) + PadLeft("in-sample", 11) +
                      PadLeft("hold-out", 10) + PadLeft("hold-out", 10) + PadLeft("", 8) + PadLeft("noise", 9) +
                      (has_truth ? PadLeft("true err", 9) : "") + "\n" + PadRight("", kNameWidth) + PadLeft("used", 9) +
                      PadLeft("px rms", 11) + PadLeft("px rms", 10) + PadLeft("mm rms", 10) + PadLeft("deg", 8) +
                      PadLeft("px", 9) + (has_truth ? PadLeft("mm", 9) : "") + "\n";
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const std::string& name = result.rig.cameras[c].name;
    const RigErrors& errors = result.errors[c];
    const auto [used, all] = CountImages(result, name);
    table += ShortName(name) + PadLeft(std::to_string(used) + "/" + std::to_string(all), 9) +
             PadLeft(FigureCell(errors.reprojection_rms_px, 3, 11), 11) +
             PadLeft(FigureCell(errors.holdout_rms_px, 3, 10), 10) +
             PadLeft(FigureCell(errors.holdout_target_mm, 3, 10), 10) +
             PadLeft(FigureCell(errors.holdout_target_deg, 2, 8), 8) +
             PadLeft(FigureCell(result.solution.pixel_sigmas_px[c], 3, 9), 9);
    if (has_truth) table += PadLeft(FigureCell(errors.truth_mm, 3, 9), 9);
    table += "\n";
  }
  return table;
}

// Describes the noise of each arm and what is known about its errors.
std::string NoiseLines(const RigResult& result) {
  std::string lines;
  for (size_t r = 0; r < result.rig.robots.size(); ++r) {
    const std::optional<RobotNoise>& noise = result.solution.robot_noise[r];
    if (noise) {
      lines += "arm " + result.rig.robots[r] + ": noise " + ShownNoise(1000 * noise->translation_m) + " mm and " +
               ShownNoise(RadToDeg(noise->rotation_rad)) + " deg\n";
    }
    for (const Finding& finding : result.verdict.findings) {
      if (finding.Name("of_arm") != result.rig.robots[r]) continue;
      lines += finding.text + (finding.action.empty() ? "" : "; " + finding.action) + "\n";
    }
  }
  if (result.holdout_chi2) {
    lines += "hold-out chi-square " + Significant(*result.holdout_chi2, 3) + " per degree of freedom\n";
  }
  return lines;
}

// Describes the targets that differ from their design.
std::string ShapeLines(const RigResult& result) {
  std::string lines;
  for (size_t t = 0; t < result.rig.targets.size(); ++t) {
    const RigTarget& target = result.rig.targets[t];
    std::vector<std::string> parts;
    for (size_t i = 0; i < TargetShape::kNumParams; ++i) {
      const std::string param(kTargetShapeParamNames[i]);
      const std::optional<double> sigma = SigmaOf(result.solution.covariance, TargetShapeBlock(target) + "." + param);
      if (!sigma) continue;
      const bool is_scale = i < 2;
      const double unit = is_scale ? 1 : 1000;
      parts.push_back(std::string(is_scale ? "scale" : "bend") + (i % 2 == 0 ? " x " : " y ") +
                      Fixed(unit * result.solution.shapes[t].params[i], is_scale ? 5 : 3) + (is_scale ? "" : " mm") +
                      " (one sigma " + ShownAmount(unit * *sigma, 2) + ")");
    }
    if (!parts.empty()) lines += "target " + target.name + ": " + Join(parts, ", ") + "\n";
  }
  return lines;
}

}  // namespace

std::pair<double, double> LargestSigmas(const Eigen::Matrix<double, 6, 6>& covariance) {
  return {std::sqrt(covariance.diagonal().head<3>().maxCoeff()), std::sqrt(covariance.diagonal().tail<3>().maxCoeff())};
}

std::pair<int, int> CountImages(const RigResult& result, const std::string& camera) {
  int used = 0;
  int all = 0;
  for (const RigImageResult& image : result.images) {
    if (image.camera != camera || !image.was_searched) continue;
    ++all;
    used += image.used ? 1 : 0;
  }
  return {used, all};
}

std::string RigTable(const RigResult& result, Colour colour) {
  const RigProblem& rig = result.rig;
  const std::string bold = colour == Colour::kAnsi ? "\x1b[1m" : "";
  const std::string plain = colour == Colour::kAnsi ? "\x1b[0m" : "";
  const auto count = [](size_t number, const std::string& what) {
    return std::to_string(number) + " " + what + (number == 1 ? "" : "s");
  };
  std::string table = bold + result.name + plain + ": " + count(rig.cameras.size(), "camera") + ", " +
                      count(rig.targets.size(), "target") + ", " + count(rig.robots.size(), "arm") + "\n" +
                      VerdictLines(result.verdict, colour) + "\n" + CamerasTable(result) + "\n";
  const Covariance& covariance = result.solution.covariance;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    table += PoseLines("camera " + rig.cameras[c].name + " in " + MountText(rig, rig.cameras[c]),
                       result.solution.poses.mount_from_camera[c],
                       *PoseCovarianceOf(covariance, CameraPoseBlock(rig.cameras[c]))) +
             IntrinsicsLine(rig.cameras[c], result.solution.cameras[c], covariance);
  }
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    table +=
        PoseLines("target " + rig.targets[t].name + " in " + MountText(rig, rig.targets[t]),
                  result.solution.poses.mount_from_target[t],
                  *PoseCovarianceOf(covariance, TargetPoseBlock(rig.targets[t])), ErrorAt(result.truth.targets, t));
  }
  for (size_t r = 1; r < rig.robots.size(); ++r) {
    table += PoseLines("base of arm " + rig.robots[r] + " in world", result.solution.poses.world_from_base[r],
                       *PoseCovarianceOf(covariance, BaseBlock(rig.robots[r])), ErrorAt(result.truth.bases, r));
  }
  for (size_t i = 0; i < result.relative_cameras.size(); ++i) {
    const RelativePose& pose = result.relative_cameras[i];
    table += PoseLines("camera " + pose.child + " in camera " + pose.parent, pose.parent_from_child, pose.covariance,
                       ErrorAt(result.truth.relative_cameras, i));
  }
  return table + NoiseLines(result) + ShapeLines(result);
}

}  // namespace heba
