#include "tools/pages/arm_section.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/arm_uncertainty.h"
#include "tools/pages/page.h"
#include "tools/pages/residual_sections.h"
#include "tools/run/arm_assessment.h"
#include "tools/text/finding_text.h"

namespace heba {
namespace {

using Json = nlohmann::ordered_json;

// The unit in which a parameter is shown, and its size in the unit of files.
struct ShownUnit {
  std::string name;
  double scale = 1;
};
ShownUnit UnitOf(const Arm& arm, int place) {
  const std::string unit(ArmParamUnit(arm, place));
  if (unit == "rad") return {"deg", RadToDeg(1.0)};
  if (unit == "m") return {"mm", 1000};
  // A compliance, which is some 1e-5.
  return unit == "m/N" ? ShownUnit{"mm/N", 1000} : ShownUnit{"deg/(N m)", RadToDeg(1.0)};
}

// The corrections of one unit.
struct Corrections {
  std::string unit;
  std::vector<std::string> names;
  std::vector<double> values;
  std::vector<double> sigmas;
};

// Returns one entry for each unit that occurs.
std::vector<Corrections> CorrectionsOfArm(const RobotSummary& robot) {
  std::vector<Corrections> all;
  for (int place = 0; place < robot.nominal.num_params(); ++place) {
    const std::optional<double>& sigma = robot.error_sigmas[static_cast<size_t>(place)];
    if (!sigma) continue;
    const ShownUnit unit = UnitOf(robot.nominal, place);
    auto same = std::find_if(all.begin(), all.end(), [&](const Corrections& other) { return other.unit == unit.name; });
    if (same == all.end()) same = all.insert(all.end(), Corrections{unit.name, {}, {}, {}});
    same->names.push_back(ArmParamName(place));
    same->values.push_back(unit.scale * robot.errors[place]);
    same->sigmas.push_back(unit.scale * *sigma);
  }
  return all;
}

std::string CorrectionsFigure(const RobotSummary& robot) {
  Json panels = Json::array();
  for (const Corrections& corrections : CorrectionsOfArm(robot)) {
    panels.push_back(Json{{"unit", corrections.unit},
                          {"names", corrections.names},
                          {"values", corrections.values},
                          {"sigmas", corrections.sigmas}});
  }
  return ViewFigure("arm-corrections", "Corrections of the arm's parameters, with one sigma to both sides.",
                    Json{{"panels", panels}});
}

// Shows a correction with the decimals that its sigma determines.
std::string ShownCorrection(double value, double sigma) {
  const int decimals = sigma > 0 ? static_cast<int>(std::ceil(1 - std::log10(sigma))) : 4;
  return Fixed(value, std::clamp(decimals, 1, 9));
}

std::string ParametersTable(const RobotSummary& robot) {
  std::vector<std::vector<PageCell>> rows;
  for (int place = 0; place < robot.nominal.num_params(); ++place) {
    const std::optional<double>& sigma = robot.error_sigmas[static_cast<size_t>(place)];
    if (!sigma) continue;
    const auto [unit, scale] = UnitOf(robot.nominal, place);
    const ArmParam param = ParamAt(place);
    const ArmJoint& joint = robot.nominal.joints[static_cast<size_t>(place / kNumArmParams)];
    // An offset is the error of the joint's zero.
    const double nominal = param == ArmParam::kTheta ? 0 : joint[param];
    rows.push_back({{ArmParamName(place)},
                    {unit},
                    {Fixed(scale * nominal, 3), true},
                    {ShownCorrection(scale * robot.errors[place], scale * *sigma), true},
                    {Significant(scale * *sigma, 2), true},
                    {Fixed(std::abs(robot.errors[place]) / *sigma, 1), true}});
  }
  return HtmlTable({"parameter", "unit", "nominal", "correction", "sigma", "correction / sigma"}, rows);
}

std::string UndeterminedText(const RobotSummary& robot) {
  if (robot.undetermined.empty()) return "";
  std::vector<std::string> texts;
  for (const auto& [name, with] : robot.undetermined) texts.push_back(name + " (" + with + ")");
  return Paragraph("Not determined, with what has the same effect or why in parentheses: " + Join(texts, ", ") + ".");
}

// A range of coordinates, mm.
struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
};

// Returns the range of the horizontal coordinate of the cells and captures of maps.
Range RangeOf(const std::vector<ArmMap>& maps) {
  Range range;
  const auto add = [&](const Eigen::Vector3d& place_m, double margin_mm) {
    range.low = std::min(range.low, 1000 * place_m[0] - margin_mm);
    range.high = std::max(range.high, 1000 * place_m[0] + margin_mm);
  };
  for (const ArmMap& map : maps) {
    for (const ArmMap::Cell& cell : map.cells) add(cell.middle_m, 500 * map.step_m);
    for (const Eigen::Vector3d& place_m : map.captures_m) add(place_m, 0);
  }
  return range;
}

double Rounded(double value, double power) { return std::round(value * power) / power; }

Json MapJson(const ArmMap& map) {
  Json cells = Json::array();
  for (const ArmMap::Cell& cell : map.cells) {
    const Eigen::Vector3d& middle_m = cell.middle_m;
    cells.push_back({Rounded(1000 * middle_m[0], 10), Rounded(1000 * middle_m[map.vertical_axis], 10),
                     Rounded(1000 * cell.correction_m, 1e4), Rounded(1000 * cell.sigma_m, 1e4)});
  }
  Json captures = Json::array();
  for (const Eigen::Vector3d& place : map.captures_m) {
    captures.push_back({Rounded(1000 * place[0], 10), Rounded(1000 * place[map.vertical_axis], 10)});
  }
  return Json{{"vertical", map.vertical_axis == 1 ? "y" : "z"},
              {"step", Rounded(1000 * map.step_m, 10)},
              {"cells", cells},
              {"captures", captures}};
}

// `fixed` names what the locator's positions are relative to.
std::string MapFigure(const GripperLocator& locate, const std::string& fixed, const RobotSummary& robot,
                      const std::vector<Rigid3d>& base_from_gripper) {
  std::vector<ArmMap> maps;
  for (const int vertical_axis : {1, 2}) {
    std::optional<ArmMap> map = MapArm(locate, robot, base_from_gripper, vertical_axis);
    if (!map) return "";
    maps.push_back(std::move(*map));
  }
  // All charts have the same scale.
  const Range x_range = RangeOf(maps);
  Json data{{"x", {Rounded(x_range.low, 10), Rounded(x_range.high, 10)}}, {"maps", Json::array()}};
  for (const ArmMap& map : maps) data["maps"].push_back(MapJson(map));
  const std::string& configuration = maps.front().configuration;
  return ViewFigure(
      "arm-map",
      "Distance between the stated and the true position of the gripper (correction), and one sigma of the true "
      "position relative to " +
          fixed + ": through the mean position of the captures, in their mean orientation" +
          (configuration.empty() ? "" : " and in the configuration " + configuration) +
          ". Dots are captures; the arm does not reach the blank positions.",
      data);
}

// Returns the poses of an arm in the captures that were used.
std::vector<Rigid3d> UsedPoses(const RunResult& result, size_t robot_index) {
  std::vector<Rigid3d> base_from_gripper;
  for (const CapturePoses& capture : result.captures) {
    const bool is_used = std::any_of(result.images.begin(), result.images.end(), [&](const ImageResult& image) {
      return image.used && image.capture == capture.name;
    });
    if (is_used) base_from_gripper.push_back(capture.base_from_gripper[robot_index]);
  }
  return base_from_gripper;
}

std::string ArmSection(const RunResult& result, size_t robot_index) {
  const RobotSummary& robot = *result.arms[robot_index];
  const std::string& name = result.rig.robots[robot_index];
  std::string text = EstimateText(robot);
  text += robot.has_recorded_joints ? " Its joints were recorded." : " Its joints were recovered from its poses.";
  if (!robot.configuration.empty()) {
    text +=
        " All captures are in one configuration (" + robot.configuration + "); in others, its errors are extrapolated.";
  }
  std::string maps;
  if (const std::optional<FixedPart> fixed = FindFixedPart(result.rig)) {
    const std::string of_single = fixed->kind == FixedPart::Kind::kCamera ? "the camera" : "the target of the captures";
    maps = MapFigure(LocatorOf(result.rig, result.solution, robot_index, *fixed),
                     name.empty() ? of_single : fixed->Name(result.rig), robot, UsedPoses(result, robot_index));
  }
  return PageSection(name.empty() ? "Arm" : "Kinematics of arm " + name,
                     Paragraph(text) + CorrectionsFigure(robot) + maps +
                         Details("All estimated parameters", ParametersTable(robot) + UndeterminedText(robot)));
}

}  // namespace

std::string EstimateText(const RobotSummary& robot) {
  return Capitalised(FindingWords(DescribeEstimate(robot)).text) + ".";
}

std::string ArmSections(const ReportData& data) {
  std::string sections;
  for (size_t r = 0; r < data.result.arms.size(); ++r) {
    if (FindEstimatedArm(data.result, r) != nullptr) sections += ArmSection(data.result, r);
  }
  return sections;
}

}  // namespace heba
