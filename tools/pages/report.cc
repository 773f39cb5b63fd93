#include "tools/pages/report.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <nlohmann/json.hpp>

#include "heba/base/distributions.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "tools/pages/arm_section.h"
#include "tools/pages/cell_figure.h"
#include "tools/pages/page.h"
#include "tools/pages/page_numbers.h"
#include "tools/pages/photograph.h"
#include "tools/pages/residual_sections.h"
#include "tools/pages/target_figure.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

using Json = nlohmann::ordered_json;

PageCell Number(const std::optional<double>& value) { return {value ? Significant(*value, 3) : "", true}; }

std::string NameOr(const std::string& name, const char* kind) { return name.empty() ? kind : name; }

// Describes the distances between a single camera, its target and their mounts.
std::string DistancesPart(const ReportData& data) {
  if (!IsShort(data.result)) return "";
  const RunResult& result = data.result;
  const CellPoses& poses = result.solution.poses;
  const auto mm = [](double metres) { return Fixed(1000 * metres, 0); };
  const Points3& points = data.target_points.front();
  const Eigen::Vector3d middle = 0.5 * (points.rowwise().minCoeff() + points.rowwise().maxCoeff());
  double nearest_m = std::numeric_limits<double>::infinity();
  double farthest_m = 0;
  for (const CapturePoses& capture : result.captures) {
    const double distance_m = (CameraFromTarget(result.rig, poses, 0, 0, capture.base_from_gripper) * middle).norm();
    nearest_m = std::min(nearest_m, distance_m);
    farthest_m = std::max(farthest_m, distance_m);
  }
  return Paragraph("From the " + MountText(result.rig, result.rig.cameras[0]) + " to the camera " +
                   mm(poses.mount_from_camera[0].translation.norm()) + " mm, from the " +
                   MountText(result.rig, result.rig.targets[0]) + " to the centre of the target " +
                   mm((poses.mount_from_target[0] * middle).norm()) + " mm, from the camera to the target " +
                   mm(nearest_m) + " to " + mm(farthest_m) + " mm.");
}

std::string SetupPart(const ReportData& data) {
  const Solution& solution = data.result.solution;
  const Problem& rig = data.result.rig;
  ShownCell cell;
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    cell.arms.push_back({rig.robots.size() == 1 ? "base" : rig.robots[r], solution.poses.world_from_base[r], {}});
    for (const CapturePoses& capture : data.result.captures) {
      cell.arms.back().base_from_gripper.push_back(capture.base_from_gripper[r]);
    }
  }
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    cell.cameras.push_back({NameOr(rig.cameras[c].name, "camera"), rig.cameras[c].mount,
                            solution.poses.mount_from_camera[c], solution.cameras[c]});
  }
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    cell.targets.push_back({NameOr(rig.targets[t].name, "target"), rig.targets[t].mount,
                            solution.poses.mount_from_target[t], data.target_points[t]});
  }
  std::map<std::string, bool> is_used;
  for (const ImageResult& image : data.result.images) is_used[image.capture] = is_used[image.capture] || image.used;
  for (const CapturePoses& capture : data.result.captures) {
    cell.captures.push_back({capture.name, is_used[capture.name]});
  }
  return CellFigure(cell) + DistancesPart(data);
}

std::string MethodsPart(const ReportData& data) {
  const RunResult& result = data.result;
  Json lines = Json::array();
  std::vector<FigureLine> rows;
  for (const Estimate& estimate : result.estimates) {
    const Errors& errors = estimate.errors;
    if (!estimate.ok) continue;
    const bool is_result = &estimate == FindRefined(result);
    lines.push_back(Json{{"label", estimate.method},
                         {"values", {OrNull(errors.reprojection_rms_px), OrNull(errors.holdout_rms_px)}},
                         {"strong", estimate.kind == EstimateKind::kRefined}});
    rows.push_back(
        {{{estimate.method + (is_result ? " (the result)" : ""), false, {}, is_result}}, FiguresOf(&estimate)});
  }
  std::string without;
  for (const auto& [reason, methods] : MethodsWithoutResult(result, HandEyeMethodNames())) {
    without += Paragraph(methods + ": no result, " + reason);
  }
  return Paragraph(
             "RMS reprojection error: on the captures that the "
             "estimate was computed from, and on captures that it has not seen.") +
         ViewFigure("dumbbells", "", Json{{"unit", "px"}, {"series", {"in-sample", "hold-out"}}, {"rows", lines}}) +
         FiguresTable({"method"},
                      {{"AX-XB, mm", &CameraFigures::axxb_mean_mm}, {"board, mm", &CameraFigures::board_mm}}, rows) +
         without;
}

// Returns a table of poses with their numbers, sigmas and, if the truth is known of any, true errors.
std::string PosesTable(const std::vector<ShownPose>& poses) {
  const bool has_truth =
      std::any_of(poses.begin(), poses.end(), [](const ShownPose& pose) { return pose.truth.has_value(); });
  std::vector<std::string> head = {"pose", "value", "one sigma, mm", "deg"};
  if (has_truth) head.insert(head.end(), {"true error, mm", "deg"});
  std::vector<std::vector<PageCell>> rows;
  for (const ShownPose& shown : poses) {
    const auto [sigma_m, sigma_rad] = LargestSigmas(shown.covariance.value_or(Matrix6::Zero()));
    std::vector<PageCell>& row = rows.emplace_back();
    row = {{shown.what},
           {PoseText(shown.pose, 1000 * sigma_m, sigma_rad)},
           {ShownAmount(1000 * sigma_m, 2), true},
           {ShownAmount(RadToDeg(sigma_rad), 2), true}};
    if (!has_truth) continue;
    row.push_back(Number(shown.truth ? std::optional(shown.truth->mm) : std::nullopt));
    row.push_back(Number(shown.truth ? std::optional(shown.truth->deg) : std::nullopt));
  }
  return HtmlTable(head, rows);
}

// Shows the poses of a rig, which the record of a single camera has.
std::string PosesPart(const ReportData& data) {
  const std::vector<ShownPose> poses = PosesOf(data.result);
  return Paragraph("Sigmas are those along and about the least certain axis.") + PosesTable(poses) +
         Details("The poses in notations to copy", PoseParts(poses, ""));
}

std::string RelativePart(const ReportData& data) {
  const RunResult& result = data.result;
  std::vector<ShownPose> shown;
  const auto add = [&](const std::string& kind, const RelativePose& pose, const std::optional<PoseError>& truth) {
    shown.push_back({kind + " " + pose.child + " in " + kind + " " + pose.parent, "", pose.parent_from_child,
                     pose.covariance, truth});
  };
  for (size_t i = 0; i < result.relative_cameras.size(); ++i) {
    add("camera", result.relative_cameras[i], ErrorAt(result.truth.relative_cameras, i));
  }
  for (const RelativePose& pose : result.relative_targets) add("target", pose, std::nullopt);
  if (shown.empty()) return "";
  return Paragraph("The covariance of each pose comes from the joint adjustment: errors that both ends share cancel.") +
         PosesTable(shown);
}

// Shows the intrinsics of a rig, which the record of a single camera has.
std::string IntrinsicsPart(const ReportData& data) {
  return Paragraph("Focal lengths and principal points are in px. Parameters without a sigma were held.") +
         "<div class=\"tables\">\n" + IntrinsicsTables(data) + "</div>\n";
}

// Returns a figure of the ellipses of a camera: of the position of the target or of the camera (mm^2), and of the
// camera's orientation.
std::string EllipsesFigure(const Solution& solution, const Eigen::Matrix3d& position_mm2, const Matrix6& camera,
                           const std::string& caption) {
  // The 95 % ellipse of two coordinates from the F distribution with the degrees of freedom of the noise estimate.
  const double reach_95 = std::sqrt(2 * FisherQuantile(0.05, 2, solution.covariance_dof));
  Json ellipses = Json::array();
  const auto add = [&](const char* x, const char* y, const char* unit, const Eigen::Matrix3d& matrix, Eigen::Index j) {
    ellipses.push_back(Json{{"x_label", x},
                            {"y_label", y},
                            {"unit", unit},
                            {"covariance", {matrix(0, 0), matrix(0, j), matrix(j, j)}},
                            {"reach_95", reach_95}});
  };
  add("x", "y", "mm", position_mm2, 1);
  add("x", "z", "mm", position_mm2, 2);
  const Eigen::Matrix3d rotation = std::pow(RadToDeg(1.0), 2) * camera.block<3, 3>(3, 3);
  add("about x", "about y", "deg", rotation, 1);
  add("about x", "about z", "deg", rotation, 2);
  return ViewFigure("ellipses",
                    caption +
                        "one sigma (filled) and 95 % (dashed), along and about the camera's axes; z "
                        "is its optical axis.",
                    Json{{"ellipses", ellipses}});
}

// Shows the uncertainty of a target that each camera locates at its working point, or that of the camera's position if
// it has none.
std::string UncertaintyPart(const ReportData& data) {
  const Solution& solution = data.result.solution;
  std::string figures;
  for (size_t c = 0; c < data.result.rig.cameras.size(); ++c) {
    const ProblemCamera& camera = data.result.rig.cameras[c];
    const auto covariance = PoseCovarianceOf(solution.covariance, CameraPoseBlock(camera));
    if (!covariance) continue;
    const std::optional<WorkingPoint> point =
        c < data.result.working_points.size() ? data.result.working_points[c] : std::nullopt;
    const std::string of_camera = camera.name.empty() ? "" : " of camera " + camera.name;
    const Eigen::Matrix3d position_m2 =
        point ? point->covariance_m2 : Eigen::Matrix3d(covariance->topLeftCorner<3, 3>());
    figures += EllipsesFigure(
        solution, 1e6 * position_m2, *covariance,
        "Uncertainty of " +
            (point ? "a target at the working point" + of_camera : "the position" + of_camera + " in its mount") +
            ", in mm, and of the camera's orientation, in deg: ");
  }
  return figures;
}

// Shows the noise of the arms, and why the kinematics of a known arm were not estimated.
std::string ArmsPart(const ReportData& data) {
  const RunResult& result = data.result;
  const auto& all = result.solution.smooth_noise;
  const bool has_smooth = std::any_of(all.begin(), all.end(), [](const auto& noise) { return noise.has_value(); });
  std::vector<std::vector<PageCell>> rows;
  for (size_t r = 0; r < result.rig.robots.size(); ++r) {
    const std::optional<RobotNoise>& noise = result.solution.robot_noise[r];
    if (!noise) continue;
    rows.push_back({{NameOr(result.rig.robots[r], "robot")},
                    {ShownNoise(1000 * noise->translation_m), true},
                    {ShownNoise(RadToDeg(noise->rotation_rad)), true}});
    const std::optional<RobotNoise> smooth = SmoothNoiseOf(result.solution, r);
    if (!has_smooth) continue;
    rows.back().push_back({smooth ? ShownNoise(1000 * smooth->translation_m) : "", true});
    rows.back().push_back({smooth ? ShownNoise(RadToDeg(smooth->rotation_rad)) : "", true});
  }
  std::string declined;
  for (const std::optional<RobotSummary>& arm : result.arms) {
    if (arm && !arm->is_estimated) declined += Paragraph(EstimateText(*arm));
  }
  if (rows.empty()) return declined;
  std::vector<std::string> head = {"arm", "noise, mm", "deg"};
  std::string text =
      "The noise of the poses that each arm reports (one sigma along and about each axis of the gripper). A capture's "
      "error is common to all its images.";
  if (has_smooth) {
    head.insert(head.end(), {"smooth errors, mm", "deg"});
    text += " Smooth errors vary with the pose of the arm, and are nearly the same for neighbouring captures.";
  }
  return Paragraph(text) + HtmlTable(head, rows) + declined;
}

// Returns whether an unknown is an effect of smooth errors, which has a meaning only beside the others of its arm.
bool IsOfSmoothErrors(const Problem& rig, const std::string& unknown) {
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(rig, r);
    const bool is_smooth = effects != nullptr && effects->kind == SharedEffectsKind::kSmooth;
    if (is_smooth && unknown.starts_with(ErrorsBlock(rig.robots[r]) + ".")) return true;
  }
  return false;
}

std::string CorrelationFigure(const ReportData& data) {
  const Covariance& covariance = data.result.solution.covariance;
  std::vector<std::string> names;
  std::vector<Eigen::Index> positions;
  for (Eigen::Index i = 0; i < covariance.layout.size(); ++i) {
    if (IsOfSmoothErrors(data.result.rig, covariance.layout.Name(i))) continue;
    names.push_back(covariance.layout.Name(i));
    positions.push_back(i);
  }
  constexpr size_t kMostNames = 80;  // More cannot be read.
  if (names.size() > kMostNames) return "";
  const Eigen::MatrixXd kept = covariance.matrix(positions, positions);
  const Eigen::VectorXd scale = kept.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd correlation = scale.asDiagonal() * kept * scale.asDiagonal();
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < correlation.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < correlation.cols(); ++j) row.push_back(Rounded(correlation(i, j), 3));
    rows.push_back(row);
  }
  return ViewFigure("correlation", "Strong colours off the diagonal mark parameters that the captures cannot separate.",
                    Json{{"names", names}, {"matrix", rows}});
}

// Returns the RMS error of the points that the estimate used in an image, or of all if it used none.
std::optional<double> RmsOf(const ImageResult& image) {
  SquaredErrors sum;
  for (const TargetInImage& target : image.targets) {
    if (target.used != image.used || !target.rms_px) continue;
    const int num_points = target.num_points - (target.used ? target.num_rejected : 0);
    sum.Add({*target.rms_px * *target.rms_px * num_points, num_points});
  }
  return sum.RmsPx();
}

// A row of the table of captures with the titles of its columns.
struct CaptureRow {
  std::vector<std::string> titles;
  std::vector<PageCell> cells;

  void Add(const std::string& title, PageCell cell) {
    titles.push_back(title);
    cells.push_back(std::move(cell));
  }
  void Add(const std::string& title, const std::optional<double>& value) {
    Add(title, PageCell{value ? Significant(*value, 2) : "", true});
  }
  // Adds the sizes of a motion of which the tangent is in m and rad.
  void AddMotion(const std::string& title, const std::optional<Tangent6>& tangent) {
    Add(title + ", mm", tangent ? std::optional(1000 * tangent->head<3>().norm()) : std::nullopt);
    Add("deg", tangent ? std::optional(RadToDeg(tangent->tail<3>().norm())) : std::nullopt);
  }
};

// `entry` is an index in RunResult::images, and `capture` is that of the image; null if it belongs to none.
CaptureRow RowOf(const ReportData& data, size_t entry, const CapturePoses* capture) {
  const ImageResult& image = data.result.images[entry];
  std::vector<std::string> targets;
  int num_points = 0;
  int num_rejected = 0;
  for (const TargetInImage& target : image.targets) {
    targets.push_back(target.target);
    num_points += target.num_points;
    num_rejected += target.num_rejected;
  }
  CaptureRow row;
  row.Add("no.", PageCell{std::to_string(entry + 1), true});
  row.Add("capture", PageCell{image.capture});
  if (!IsShort(data.result)) {
    row.Add("camera", PageCell{image.camera});
    row.Add("image", PageCell{image.image});
    row.Add("targets", PageCell{Join(targets, ", ")});
  }
  row.Add("status", PageCell{image.used ? "used" : "not used"});
  row.Add("points", PageCell{std::to_string(num_points), true});
  row.Add("left out", PageCell{std::to_string(num_rejected), true});
  row.Add("rms, px", Number(RmsOf(image)));
  row.Add("hold-out, mm", PageCell{image.holdout_target_mm ? ShownAmount(*image.holdout_target_mm, 2) : "", true});
  const std::optional<CaptureMove>& move = image.move_without;
  row.AddMotion("result changes without it", move ? std::optional(move->tangent) : std::nullopt);
  row.Add("chance", PageCell{move ? ShownPValue(move->p_value) : "", true});
  for (size_t r = 0; r < data.result.rig.robots.size() && data.has_corrections; ++r) {
    const bool is_corrected = capture != nullptr && !capture->corrections.empty();
    row.AddMotion(NameOr(data.result.rig.robots[r], "robot") + " correction",
                  is_corrected ? std::optional(LocalCoordinates(Rigid3d(), capture->corrections[r])) : std::nullopt);
  }
  row.Add("remark", PageCell{image.reason});
  return row;
}

std::string CapturesSection(const ReportData& data) {
  std::map<std::string, const CapturePoses*> capture_of;
  for (const CapturePoses& capture : data.result.captures) capture_of[capture.name] = &capture;
  std::vector<std::string> head;
  std::vector<std::vector<PageCell>> rows;
  for (size_t e = 0; e < data.result.images.size(); ++e) {
    CaptureRow row = RowOf(data, e, capture_of[data.result.images[e].capture]);
    head = std::move(row.titles);
    rows.push_back(std::move(row.cells));
  }
  std::vector<OpenedCapture> opens(data.has_images() ? rows.size() : 0);
  for (size_t c = 0; c < data.residuals.size(); ++c) {
    const std::vector<ReportedImage>& images = data.residuals[c].images;
    for (size_t i = 0; i < images.size(); ++i) opens[images[i].entry] = {ImagesName(data, c), i};
  }
  const char* const text =
      "The RMS is that with the poses of the arms as reported. The change is that of the camera's pose if its capture "
      "is left out.";
  return Heading("Captures") + (data.has_images() ? Paragraph(text) : "") + HtmlTable(head, rows, opens);
}

// A section of the page. It is shown if it has content.
struct ReportSection {
  enum class For { kAll, kSingle, kCell };  // A single camera, or a rig.
  const char* title;                        // Empty if the content has its own headings.
  std::string (*content)(const ReportData& data);
  For whom = For::kAll;
  bool needs_images = true;
};
constexpr ReportSection kSections[] = {
    {"Methods", MethodsPart, ReportSection::For::kSingle, false},
    {"Poses", PosesPart, ReportSection::For::kCell},
    {"Poses between cameras and between targets", RelativePart},
    {"Intrinsics", IntrinsicsPart, ReportSection::For::kCell},
    {"", ResidualSections},
    {"Points of the target", TargetFigures},
    {"Uncertainty at the working point", UncertaintyPart},
    {"Arms", ArmsPart},
    {"", ArmSections},
    {"Parameter correlation", CorrelationFigure},
    {"", CapturesSection, ReportSection::For::kAll, false},
};

bool IsFor(const ReportSection& section, const ReportData& data) {
  const bool is_single = section.whom == ReportSection::For::kSingle;
  return (section.whom == ReportSection::For::kAll || is_single == IsShort(data.result)) &&
         (data.has_images() || !section.needs_images);
}

}  // namespace

std::string ReportPage(const ReportData& data, const ReportContext& context) {
  // People look at the verdict, the cell and a photograph first.
  const std::string cell = data.has_images() ? SetupPart(data) + BestPhotograph(data) : "";
  std::string body = RecordSection(data, context, cell);
  for (const ReportSection& section : kSections) {
    if (!IsFor(section, data)) continue;
    const std::string content = section.content(data);
    body += section.title[0] == '\0' ? content : PageSection(section.title, content);
  }
  return HtmlPage(TitleOf(data, context), body + Details("Config as used", CopyableText(context.config_used)));
}

}  // namespace heba
