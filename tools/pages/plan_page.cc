#include "tools/pages/plan_page.h"

#include <vector>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/data/hand_eye.h"
#include "tools/pages/cell_figure.h"
#include "tools/pages/page.h"
#include "tools/text/plan_text.h"

namespace heba {
namespace {

// Returns the cell with the arm at every planned capture.
std::string CellOf(const PlanConfig& config, const CapturePlan& plan) {
  const Problem problem =
      HandEyeProblem(config.cell.setup, config.cell.camera, DesignedShape(config.cell.points_in_target));
  ShownCell cell;
  ShownArm& arm = cell.arms.emplace_back();
  arm.name = "base";
  const std::vector<std::string> images = PlannedImages(plan, config.former_names);
  for (size_t i = 0; i < plan.captures.size(); ++i) {
    arm.base_from_gripper.push_back(plan.captures[i].base_from_gripper);
    cell.captures.push_back({images[i], true});
  }
  cell.cameras.push_back(
      {"camera", problem.cameras.front().mount, config.cell.hand_eye.camera_mount_from_camera, config.cell.camera});
  cell.targets.push_back({"target", problem.targets.front().mount, config.cell.hand_eye.target_mount_from_target,
                          config.cell.points_in_target});
  return CellFigure(cell);
}

// Returns the expected image of a capture as an SVG: a frame with the points of the target.
std::string ImageOf(const PlanCell& cell, const PlannedCapture& capture, const std::string& name) {
  const double width = cell.camera.width_px;
  const double height = cell.camera.height_px;
  std::string svg = "<figure style=\"margin:0\"><svg viewBox=\"0 0 " + Fixed(width, 0) + " " + Fixed(height, 0) +
                    "\" role=\"img\" aria-label=\"expected image " + name +
                    "\" style=\"width:100%;height:auto\"><rect x=\"0\" y=\"0\" width=\"" + Fixed(width, 0) +
                    "\" height=\"" + Fixed(height, 0) + "\" fill=\"none\" stroke=\"currentColor\" stroke-width=\"" +
                    Fixed(width / 200, 1) + "\"/>";
  for (Eigen::Index i = 0; i < cell.points_in_target.cols(); ++i) {
    const Eigen::Vector3d point = capture.camera_from_target * Eigen::Vector3d(cell.points_in_target.col(i));
    Points2 pixel;
    if (!cell.camera.Model().Project(cell.camera.params.data(), Points3(point), &pixel, nullptr)) continue;
    svg += "<circle cx=\"" + Fixed(pixel(0, 0), 1) + "\" cy=\"" + Fixed(pixel(1, 0), 1) + "\" r=\"" +
           Fixed(width / 120, 1) + "\" fill=\"rgb(13,148,136)\"" + (i == 0 ? " stroke=\"currentColor\"" : "") + "/>";
  }
  return svg + "</svg><figcaption>" + name + "</figcaption></figure>";
}

std::string TableOf(const CapturePlan& plan, const std::vector<std::string>& former_names) {
  const std::vector<std::string> images = PlannedImages(plan, former_names);
  std::vector<std::vector<PageCell>> rows;
  for (size_t i = 0; i < plan.captures.size(); ++i) {
    const PlannedCapture& capture = plan.captures[i];
    rows.push_back({{images[i]},
                    {ShownAmount(1000 * capture.target_m, 3), true},
                    {ShownAmount(1000 * capture.position_m, 3), true},
                    {ShownAmount(RadToDeg(capture.orientation_rad), 2), true},
                    {Fixed(100 * capture.visible_share, 0) + " %", true},
                    {PlannedNote(plan, i, images, former_names)}});
  }
  return HtmlTable({"capture", "located target, mm", "camera, mm", "camera, deg", "seen for certain", ""}, rows);
}

}  // namespace

std::string PlanPage(const PlanConfig& config, const CapturePlan& plan) {
  const std::vector<std::string> images = PlannedImages(plan, config.former_names);
  size_t num_new = 0;
  for (const PlannedCapture& capture : plan.captures) num_new += capture.repeats ? 0 : 1;
  std::string body = "<h1>" + EscapedForMarkup(config.name) + ": the poses to take</h1>\n";
  body += Paragraph(Capitalised(ExpectedText(plan, num_new)) + ".");
  if (!plan.untold.empty()) body += Paragraph(Capitalised(UntoldText(plan)) + ".");
  const std::string enough = EnoughText(config.requirements, plan);
  if (!enough.empty()) body += Paragraph(Capitalised(enough) + ".");
  if (num_new < plan.captures.size()) {
    body += Paragraph(
        "The last captures repeat the first poses: if the camera or the target moves during the session, they show "
        "it.");
  }
  body += Heading("The poses") + CellOf(config, plan);
  body += Heading("The images that are expected");
  body += "<div style=\"display:grid;grid-template-columns:repeat(auto-fill,minmax(170px,1fr));gap:12px\">";
  for (size_t i = 0; i < plan.captures.size(); ++i) {
    body += ImageOf(config.cell, plan.captures[i], images[i]);
  }
  body += "</div>\n";
  body += Heading("What is expected after each") +
          Paragraph(
              "One sigma, by the calibration alone. \"Seen for certain\" is the share of rough set-ups, as "
              "uncertain as stated, in which the camera sees the whole target.") +
          TableOf(plan, config.former_names);
  return HtmlPage(config.name, body);
}

}  // namespace heba
