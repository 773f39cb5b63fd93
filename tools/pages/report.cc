#include "tools/pages/report.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "heba/base/distributions.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "tools/pages/arm_section.h"
#include "tools/pages/cell_figure.h"
#include "tools/pages/page.h"
#include "tools/pages/report_charts.h"
#include "tools/pages/residual_sections.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

using Json = nlohmann::ordered_json;

const ReportedCapture* FindView(const std::vector<ReportedCapture>& captures, const std::string& image) {
  const auto found =
      std::find_if(captures.begin(), captures.end(), [&](const ReportedCapture& view) { return view.image == image; });
  return found == captures.end() ? nullptr : &*found;
}

// Describes the distances between camera, target and their mounts.
std::string DistancesText(const RunResult& result, const Estimate& refined,
                          const std::vector<ReportedCapture>& captures, const Eigen::Vector3d& target_middle) {
  const HandEye& hand_eye = refined.hand_eye;
  const auto mm = [](double metres) { return Fixed(1000 * metres, 0); };
  double nearest_m = std::numeric_limits<double>::infinity();
  double farthest_m = 0;
  for (const ReportedCapture& view : captures) {
    const Rigid3d mount = CameraMountFromTargetMount(result.setup, view.base_from_gripper);
    const double distance_m = (CameraFromTarget(hand_eye, mount) * target_middle).norm();
    nearest_m = std::min(nearest_m, distance_m);
    farthest_m = std::max(farthest_m, distance_m);
  }
  return "From the " + std::string(CameraMountName(result.setup)) + " to the camera " +
         mm(hand_eye.camera_mount_from_camera.translation.norm()) + " mm, from the " +
         std::string(TargetMountName(result.setup)) + " to the centre of the target " +
         mm((hand_eye.target_mount_from_target * target_middle).norm()) + " mm, from the camera to the target " +
         mm(nearest_m) + " to " + mm(farthest_m) + " mm.";
}

std::string SetUpSection(const RunResult& result, const Estimate& refined, const std::vector<ReportedCapture>& captures,
                         const Points3& target_points) {
  const bool is_fixed = result.setup == Setup::kEyeToHand;
  const Mount base{0, Mount::Part::kBase};
  const Mount gripper{0, Mount::Part::kGripper};
  ShownCell cell;
  cell.arms = {{"base", Rigid3d(), {}}};
  cell.cameras = {{"camera", is_fixed ? base : gripper, refined.hand_eye.camera_mount_from_camera, refined.camera}};
  cell.targets = {{"target", is_fixed ? gripper : base, refined.hand_eye.target_mount_from_target, target_points}};
  for (const CaptureResult& capture : result.captures) {
    const ReportedCapture* view = FindView(captures, capture.image);
    if (view == nullptr) continue;
    cell.arms.front().base_from_gripper.push_back(view->base_from_gripper);
    cell.captures.push_back({capture.image, capture.used});
  }
  if (cell.captures.empty()) return "";
  const Eigen::Vector3d low = target_points.rowwise().minCoeff();
  const Eigen::Vector3d high = target_points.rowwise().maxCoeff();
  const Eigen::Vector3d middle = 0.5 * (low + high);
  return PageSection("Setup", CellFigure(cell) + Paragraph(DistancesText(result, refined, captures, middle)));
}

// Returns what the sections on residuals show.
CameraResiduals ResidualsOf(const RunResult& result, const Estimate& refined,
                            const std::vector<ReportedCapture>& captures) {
  CameraResiduals residuals{refined.camera, refined.solution->pixel_sigma_px, refined.errors.reprojection_rms_px};
  for (const CaptureResult& capture : result.captures) {
    residuals.images.push_back(
        {capture.image, capture.used, capture.reason, capture.rms_px, FindView(captures, capture.image)});
  }
  return residuals;
}

std::string UncertaintySection(const RunResult& result, const Estimate& refined) {
  const Solution& solution = *refined.solution;
  // The 95 % ellipse of two coordinates from the F distribution with the degrees of freedom of the noise estimate.
  const double reach_95 = std::sqrt(2 * FisherQuantile(0.05, 2, solution.covariance_dof));
  Json ellipses = Json::array();
  std::string pictures;
  const auto add = [&](const char* x, const char* y, const char* unit, const Eigen::Matrix3d& matrix, Eigen::Index i,
                       Eigen::Index j) {
    ellipses.push_back(Json{{"x_label", x},
                            {"y_label", y},
                            {"unit", unit},
                            {"covariance", {matrix(i, i), matrix(i, j), matrix(j, j)}},
                            {"reach_95", reach_95}});
    Eigen::Matrix2d covariance;
    covariance << matrix(i, i), matrix(i, j), matrix(j, i), matrix(j, j);
    pictures += EllipseChart(std::string(x) + ", " + unit, std::string(y) + ", " + unit, covariance, reach_95);
  };
  if (result.working_point) {
    const Eigen::Matrix3d at_work = 1e6 * result.working_point->covariance_m2;
    add("x", "y", "mm", at_work, 0, 1);
    add("x", "z", "mm", at_work, 0, 2);
  }
  const Eigen::Matrix3d rotation = std::pow(RadToDeg(1.0), 2) * solution.covariance.matrix.block<3, 3>(3, 3);
  add("about x", "about y", "deg", rotation, 0, 1);
  add("about x", "about z", "deg", rotation, 0, 2);
  const std::string figure =
      ViewFigure("ellipses",
                 "Uncertainty of a target at the working point, in mm, and of the camera's orientation, in deg: one "
                 "sigma (filled) and 95 % (dashed), along and about the camera's axes; z is its "
                 "optical axis.",
                 Json{{"ellipses", ellipses}}, "<div class=\"charts\">" + pictures + "</div>");
  return figure.empty() ? "" : PageSection("Uncertainty at the working point", figure);
}

std::string MethodsSection(const RunResult& result) {
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
  return PageSection(
      "Methods",
      Paragraph("RMS reprojection error: on the captures that the "
                "estimate was computed from, and on captures that it has not seen.") +
          ViewFigure("dumbbells", "", Json{{"unit", "px"}, {"series", {"in-sample", "hold-out"}}, {"rows", lines}},
                     MethodsChart(result)) +
          FiguresTable({"method"},
                       {{"AX-XB, mm", &CameraFigures::axxb_mean_mm}, {"board, mm", &CameraFigures::board_mm}}, rows) +
          without);
}

std::string CaptureSection(const RunResult& result) {
  std::vector<std::vector<PageCell>> rows;
  bool has_corrections = false;
  for (const CaptureResult& capture : result.captures) has_corrections = has_corrections || capture.correction;
  for (size_t i = 0; i < result.captures.size(); ++i) {
    const CaptureResult& capture = result.captures[i];
    std::vector<PageCell> row = {{std::to_string(i + 1), true},
                                 {capture.image},
                                 {capture.used ? "used" : "not used"},
                                 {std::to_string(capture.num_points), true},
                                 {std::to_string(capture.num_rejected), true},
                                 {capture.rms_px ? Significant(*capture.rms_px, 3) : "", true},
                                 {capture.holdout_target_mm ? ShownAmount(*capture.holdout_target_mm, 2) : "", true}};
    for (PageCell& cell : MoveCells(capture.move_without)) row.push_back(std::move(cell));
    if (has_corrections) {
      const bool has = capture.correction.has_value();
      row.push_back({has ? Significant(1000 * capture.correction->translation.norm(), 2) : "", true});
      row.push_back({has ? Significant(RadToDeg(LogRotation(capture.correction->rotation).norm()), 2) : "", true});
    }
    row.push_back({capture.reason});
    rows.push_back(std::move(row));
  }
  std::vector<std::string> head = {"no.",      "capture", "status",       "points",
                                   "left out", "rms, px", "hold-out, mm", "result changes without it, mm",
                                   "deg",      "chance"};
  if (has_corrections) head.insert(head.end(), {"robot correction, mm", "deg"});
  head.emplace_back("remark");
  return Heading("Captures") + HtmlTable(head, rows, true);
}

}  // namespace

std::string ReportPage(const RunResult& result, const std::vector<ReportedCapture>& captures,
                       const Points3& target_points, const ReportContext& context) {
  const Estimate* refined = FindRefined(result);
  std::string body = RecordSection(result, context);
  // Without a refined estimate only poses of the target were given, so there are no image measurements to show.
  if (refined == nullptr) {
    body += MethodsSection(result);
  } else {
    const CameraResiduals residuals = ResidualsOf(result, *refined, captures);
    body += ResidualData("captures", residuals) + SetUpSection(result, *refined, captures, target_points) +
            MethodsSection(result) + ResidualSections("captures", residuals) + UncertaintySection(result, *refined) +
            ArmSection(result, *refined, captures) + CorrelationSection(refined->solution->covariance);
  }
  return HtmlPage(result.name,
                  body + CaptureSection(result) + Details("Config as used", CopyableText(context.config_used)));
}

}  // namespace heba
