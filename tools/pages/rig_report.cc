#include "tools/pages/rig_report.h"

#include <algorithm>
#include <map>
#include <utility>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/pages/arm_section.h"
#include "tools/pages/cell_figure.h"
#include "tools/pages/page.h"
#include "tools/pages/residual_sections.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

PageCell Number(const std::optional<double>& value) { return {value ? Significant(*value, 3) : "", true}; }

std::vector<PageCell> SigmaCells(const Matrix6& covariance) {
  const auto [sigma_m, sigma_rad] = LargestSigmas(covariance);
  return {{ShownAmount(1000 * sigma_m, 2), true}, {ShownAmount(RadToDeg(sigma_rad), 2), true}};
}

std::string CellSection(const RigDataset& dataset, const RigRunOutput& run) {
  const RigSolution& solution = run.result.solution;
  const RigProblem& rig = run.result.rig;
  ShownCell cell;
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    cell.arms.push_back({rig.robots.size() == 1 ? "base" : rig.robots[r], solution.poses.world_from_base[r], {}});
    for (const RigRecording& capture : dataset.captures) {
      cell.arms.back().base_from_gripper.push_back(capture.base_from_gripper[r]);
    }
  }
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    cell.cameras.push_back(
        {rig.cameras[c].name, rig.cameras[c].mount, solution.poses.mount_from_camera[c], solution.cameras[c]});
  }
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    cell.targets.push_back({rig.targets[t].name, rig.targets[t].mount, solution.poses.mount_from_target[t],
                            AllPoints(*dataset.targets[t]).points_in_target});
  }
  std::map<std::string, bool> is_used;
  for (const RigImageResult& image : run.result.images) is_used[image.capture] = is_used[image.capture] || image.used;
  for (const RigRecording& capture : dataset.captures) {
    cell.captures.push_back({capture.name, is_used[capture.name]});
  }
  return PageSection("Cell", CellFigure(cell));
}

std::string CamerasSection(const RigResult& result) {
  std::vector<FigureLine> rows;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const RigCamera& camera = result.rig.cameras[c];
    const auto [used, all] = CountImages(result, camera.name);
    rows.push_back({{{camera.name, false, {}, true},
                     {MountText(result.rig, camera)},
                     {std::to_string(used) + " of " + std::to_string(all), true}},
                    FiguresOf(result, c)});
  }
  return PageSection("Cameras", Paragraph("RMS reprojection errors with the poses of the arms as reported: on the "
                                          "captures of the estimate, and on captures that it has not seen.") +
                                    FiguresTable({"camera", "mount", "images used"},
                                                 {{"pixel noise, px", &CameraFigures::pixel_sigma_px}}, rows));
}

// A pose of the result: its frames, and its error if the truth is known.
struct ShownPose {
  std::string what;
  Rigid3d pose;
  Matrix6 covariance;
  std::optional<PoseError> truth = std::nullopt;
};

// Returns a table of poses with their numbers, sigmas and, if the truth is known of any, true errors.
std::string PosesTable(const std::vector<ShownPose>& poses) {
  const bool has_truth =
      std::any_of(poses.begin(), poses.end(), [](const ShownPose& pose) { return pose.truth.has_value(); });
  std::vector<std::string> head = {"pose", "value", "one sigma, mm", "deg"};
  if (has_truth) head.insert(head.end(), {"true error, mm", "deg"});
  std::vector<std::vector<PageCell>> rows;
  for (const ShownPose& shown : poses) {
    const auto [sigma_m, sigma_rad] = LargestSigmas(shown.covariance);
    std::vector<PageCell>& row = rows.emplace_back();
    row = {{shown.what}, {PoseText(shown.pose, 1000 * sigma_m, sigma_rad)}};
    for (PageCell& cell : SigmaCells(shown.covariance)) row.push_back(std::move(cell));
    if (!has_truth) continue;
    row.push_back(Number(shown.truth ? std::optional(shown.truth->mm) : std::nullopt));
    row.push_back(Number(shown.truth ? std::optional(shown.truth->deg) : std::nullopt));
  }
  return HtmlTable(head, rows);
}

std::string PosesSection(const RigResult& result) {
  const RigProblem& rig = result.rig;
  const RigPoses& poses = result.solution.poses;
  const auto covariance_of = [&](const std::string& block) {
    return *PoseCovarianceOf(result.solution.covariance, block);
  };
  std::vector<ShownPose> shown;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const RigErrors& errors = result.errors[c];
    shown.push_back({"camera " + rig.cameras[c].name + " in " + MountText(rig, rig.cameras[c]),
                     poses.mount_from_camera[c], covariance_of(CameraPoseBlock(rig.cameras[c]))});
    if (errors.truth_mm) shown.back().truth = PoseError{*errors.truth_mm, *errors.truth_deg};
  }
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    shown.push_back({"target " + rig.targets[t].name + " in " + MountText(rig, rig.targets[t]),
                     poses.mount_from_target[t], covariance_of(TargetPoseBlock(rig.targets[t])),
                     ErrorAt(result.truth.targets, t)});
  }
  for (size_t r = 1; r < rig.robots.size(); ++r) {
    shown.push_back({"base of arm " + rig.robots[r] + " in world", poses.world_from_base[r],
                     covariance_of(BaseBlock(rig.robots[r])), ErrorAt(result.truth.bases, r)});
  }
  return PageSection("Poses",
                     Paragraph("Sigmas are those along and about the least certain axis.") + PosesTable(shown));
}

std::string IntrinsicsSection(const RigDataset& dataset, const RigResult& result) {
  std::string tables;
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const RigCamera& camera = result.rig.cameras[c];
    const std::optional<Camera> truth = dataset.truth ? dataset.truth->cameras[c] : std::nullopt;
    tables += IntrinsicsTable(camera.name, result.solution.cameras[c], result.solution.covariance, CameraBlock(camera),
                              truth ? &*truth : nullptr);
  }
  return PageSection("Intrinsics", Paragraph("Focal lengths and principal points are in px. Parameters without a sigma "
                                             "were held.") +
                                       "<div class=\"tables\">\n" + tables + "</div>\n");
}

std::string RelativeSection(const RigResult& result) {
  std::vector<ShownPose> shown;
  for (size_t i = 0; i < result.relative_cameras.size(); ++i) {
    const RelativePose& pose = result.relative_cameras[i];
    shown.push_back({"camera " + pose.child + " in camera " + pose.parent, pose.parent_from_child, pose.covariance,
                     ErrorAt(result.truth.relative_cameras, i)});
  }
  for (const RelativePose& pose : result.relative_targets) {
    shown.push_back({"target " + pose.child + " in target " + pose.parent, pose.parent_from_child, pose.covariance});
  }
  if (shown.empty()) return "";
  return PageSection("Poses between cameras and between targets",
                     Paragraph("The covariance of each pose comes from the joint adjustment: errors that both ends "
                               "share cancel.") +
                         PosesTable(shown));
}

std::string ArmsSection(const RigResult& result) {
  const auto& all = result.solution.smooth_noise;
  const bool has_smooth = std::any_of(all.begin(), all.end(), [](const auto& noise) { return noise.has_value(); });
  std::vector<std::vector<PageCell>> rows;
  for (size_t r = 0; r < result.rig.robots.size(); ++r) {
    const std::optional<RobotNoise>& noise = result.solution.robot_noise[r];
    if (!noise) continue;
    rows.push_back({{result.rig.robots[r]},
                    {ShownNoise(1000 * noise->translation_m), true},
                    {ShownNoise(RadToDeg(noise->rotation_rad)), true}});
    const std::optional<RobotNoise> smooth = SmoothNoiseOf(result.solution, r);
    if (!has_smooth) continue;
    rows.back().push_back({smooth ? ShownNoise(1000 * smooth->translation_m) : "", true});
    rows.back().push_back({smooth ? ShownNoise(RadToDeg(smooth->rotation_rad)) : "", true});
  }
  if (rows.empty()) return "";
  std::vector<std::string> head = {"arm", "noise, mm", "deg"};
  std::string text =
      "The noise of the poses that each arm reports (one sigma along and about each axis of the gripper). A capture's "
      "error is common to all its images.";
  if (has_smooth) {
    head.insert(head.end(), {"smooth errors, mm", "deg"});
    text += " Smooth errors vary with the pose of the arm, and are nearly the same for neighbouring captures.";
  }
  return PageSection("Arms", Paragraph(text) + HtmlTable(head, rows));
}

std::string KinematicsSections(const RigResult& result) {
  std::string sections;
  for (size_t r = 0; r < result.arms.size(); ++r) {
    if (!result.arms[r]) continue;
    sections += ArmOfRigSection("Kinematics of arm " + result.rig.robots[r], result, r);
  }
  return sections;
}

// Returns the RMS error of the points that the estimate used in an image, or of all if it used none.
std::optional<double> RmsOf(const RigImageResult& image) {
  SquaredErrors sum;
  for (const RigTargetInImage& target : image.targets) {
    if (target.used != image.used || !target.rms_px) continue;
    const int num_points = target.num_points - (target.used ? target.num_rejected : 0);
    sum.Add({*target.rms_px * *target.rms_px * num_points, num_points});
  }
  return sum.RmsPx();
}

// Returns whether the poses of the arms have corrections.
bool HasCorrections(const RigRunOutput& run) {
  const std::vector<RigCaptureOutcome>& captures = run.calibration.refined->captures;
  return std::any_of(captures.begin(), captures.end(),
                     [](const RigCaptureOutcome& capture) { return !capture.corrections.empty(); });
}

// The images of one camera, as the sections on residuals show them. Their residuals are those that remain after the
// corrections of the arms, which are to be compared with the noise of the pixels.
struct ShownImages {
  std::vector<ReportedCapture> captures;
  CameraResiduals residuals;
};

ShownImages ImagesOf(const RigRunOutput& run, size_t camera) {
  const RigSolution& solution = run.result.solution;
  const RigSolution& refined = *run.calibration.refined;
  const std::string& name = run.result.rig.cameras[camera].name;
  ShownImages shown;
  shown.residuals.camera = solution.cameras[camera];
  shown.residuals.sigma_px = solution.pixel_sigmas_px[camera];
  if (HasCorrections(run)) shown.residuals.condition = " after the corrections of the arms";
  std::map<size_t, std::string> jpeg_of;
  for (const RigDetection& detection : run.detections) {
    if (detection.camera == camera && !detection.detection.small_jpeg.empty()) {
      jpeg_of[detection.capture] = detection.detection.small_jpeg;
    }
  }
  std::map<std::string, size_t> place_of;
  std::map<std::string, SquaredErrors> errors_of;
  SquaredErrors all_errors;
  for (size_t i = 0; i < run.calibration.problem.captures.size(); ++i) {
    const RigCapture& capture = run.calibration.problem.captures[i];
    ReportedCapture& reported = shown.captures.emplace_back();
    reported.image = capture.name;
    reported.small_jpeg = jpeg_of[i];
    place_of[capture.name] = i;
    for (size_t k = 0; k < capture.images.size(); ++k) {
      const RigImage& image = capture.images[k];
      if (image.camera != camera || image.observations.size() == 0) continue;
      const Rigid3d camera_from_target =
          CameraFromTarget(run.calibration.problem, solution.poses, camera, image.target,
                           Corrected(WithErrors(capture, refined.effects), refined.captures[i].corrections));
      const std::optional<Points2> residuals = Residuals(solution.cameras[camera], camera_from_target,
                                                         ApplyShape(image.observations, solution.shapes[image.target]));
      if (!residuals) continue;
      const std::vector<int>& rejected = refined.captures[i].rejected_ids[k];
      for (Eigen::Index p = 0; p < residuals->cols(); ++p) {
        const int id = image.observations.ids[static_cast<size_t>(p)];
        const bool is_out = std::find(rejected.begin(), rejected.end(), id) != rejected.end();
        Points2& pixels = is_out ? reported.left_out_pixels : reported.pixels;
        Points2& errors = is_out ? reported.left_out_residuals : reported.residuals;
        if (!is_out) errors_of[capture.name].Add({residuals->col(p).squaredNorm(), 1});
        pixels.conservativeResize(2, pixels.cols() + 1);
        errors.conservativeResize(2, errors.cols() + 1);
        pixels.rightCols<1>() = image.observations.pixels.col(p);
        errors.rightCols<1>() = residuals->col(p);
      }
    }
  }
  for (const RigImageResult& image : run.result.images) {
    if (image.camera != name || !image.was_searched) continue;
    std::vector<std::string> targets;
    for (const RigTargetInImage& target : image.targets) targets.push_back(target.target);
    const std::string number = std::to_string(shown.residuals.images.size() + 1);
    const SquaredErrors& errors = errors_of[image.capture];
    all_errors.Add(errors);
    shown.residuals.images.push_back(
        {image.capture, image.used, image.reason, errors.RmsPx(), nullptr,
         "camera " + name + ", image " + number + ": " + image.image +
             (targets.empty() ? "" : (targets.size() == 1 ? ", target " : ", targets ") + Join(targets, ", "))});
  }
  shown.residuals.rms_px = all_errors.RmsPx();
  for (CameraResiduals::Image& image : shown.residuals.images) image.shown = &shown.captures[place_of[image.name]];
  return shown;
}

// States how the residuals of a camera compare with its noise.
std::string ResidualText(const RigErrors& errors, const CameraResiduals& residuals) {
  std::string text = "The RMS of the residuals is " + FigureText(residuals.rms_px) + " px" + residuals.condition;
  if (!residuals.condition.empty()) {
    text += ", and " + FigureText(errors.reprojection_rms_px) + " px with the poses as the arms report them";
  }
  return text + "; the pixel noise is " + Significant(residuals.sigma_px, 3) +
         " px (one sigma of a coordinate; the RMS of points with this noise is 1.4 times as large).";
}

std::string ImagesTable(const RigResult& result) {
  std::vector<std::vector<PageCell>> rows;
  for (const RigImageResult& image : result.images) {
    std::vector<std::string> targets;
    int num_points = 0;
    int num_rejected = 0;
    for (const RigTargetInImage& target : image.targets) {
      targets.push_back(target.target);
      num_points += target.num_points;
      num_rejected += target.num_rejected;
    }
    std::vector<PageCell>& row = rows.emplace_back();
    row = {{image.capture},
           {image.camera},
           {image.image},
           {Join(targets, ", ")},
           {image.used ? "used" : "not used"},
           {std::to_string(num_points), true},
           {std::to_string(num_rejected), true},
           Number(RmsOf(image))};
    for (PageCell& cell : MoveCells(image.move_without)) row.push_back(std::move(cell));
    row.push_back({image.reason});
  }
  return Heading("Images") +
         Paragraph(
             "The RMS is that with the poses of the arms as reported. The change is that of the camera's pose if "
             "its capture is left out.") +
         HtmlTable({"capture", "camera", "image", "targets", "status", "points", "left out", "rms, px",
                    "result changes without it, mm", "deg", "chance", "remark"},
                   rows);
}

std::string RigRecord(const RigResult& result, const ReportContext& context) {
  std::vector<std::pair<std::string, std::string>> facts = {{"cameras", std::to_string(result.rig.cameras.size())}};
  for (size_t t = 0; t < result.rig.targets.size(); ++t) {
    facts.emplace_back("target " + result.rig.targets[t].name,
                       result.target_types[t] + " on " + MountText(result.rig, result.rig.targets[t]));
  }
  facts.emplace_back(
      "captures", std::to_string(NumUsedCaptures(result)) + " of " + std::to_string(result.captures.size()) + " used");
  return RecordPart(std::move(facts), result.about, context);
}

// Returns the arguments of heba locate: an image of each camera, and the pose of each arm that carries one.
std::string LocatedWith(const RigProblem& rig) {
  std::vector<std::string> arguments;
  std::vector<std::string> poses;
  for (const RigCamera& camera : rig.cameras) arguments.push_back(ShellWord(camera.name) + "=IMAGE");
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    const bool is_needed = std::any_of(rig.cameras.begin(), rig.cameras.end(), [&](const RigCamera& camera) {
      return camera.mount == Mount{r, Mount::Part::kGripper};
    });
    if (is_needed) poses.push_back(rig.robots.size() == 1 ? "NUMBERS" : rig.robots[r] + "=NUMBERS");
  }
  if (!poses.empty()) arguments.push_back("--pose " + ShellWord(Join(poses, ";")));
  return Join(arguments, " ");
}

}  // namespace

std::string RigReportPage(const RigDataset& dataset, const RigRunOutput& run, const ReportContext& context) {
  const RigResult& result = run.result;
  std::string body = "<div class=\"record-page\">\n<h1>" + EscapedForMarkup(result.name) + "</h1>\n" +
                     VerdictPart(result.verdict) + CamerasSection(result) +
                     NextPart(result.verdict, context, LocatedWith(result.rig)) + RigRecord(result, context) +
                     "</div>\n" + CellSection(dataset, run) + PosesSection(result) + RelativeSection(result) +
                     IntrinsicsSection(dataset, result) + ArmsSection(result) + KinematicsSections(result);
  for (size_t c = 0; c < result.rig.cameras.size(); ++c) {
    const std::string name = "captures_" + std::to_string(c);
    const ShownImages shown = ImagesOf(run, c);
    body += Heading("Camera " + result.rig.cameras[c].name) +
            Paragraph(ResidualText(result.errors[c], shown.residuals)) + ResidualData(name, shown.residuals) +
            ResidualSections(name, shown.residuals);
  }
  return HtmlPage(result.name, body + CorrelationSection(result.solution.covariance) + ImagesTable(result) +
                                   Details("Config as used", CopyableText(context.config_used)));
}

}  // namespace heba
