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
#include "tools/pages/static_chart.h"
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

// Draws one row per parameter: a dot at its correction and a line of one sigma to both sides.
std::string CorrectionsChart(const Corrections& corrections) {
  double reach = 0;
  for (size_t i = 0; i < corrections.names.size(); ++i) {
    reach = std::max(reach, std::abs(corrections.values[i]) + corrections.sigmas[i]);
  }
  if (!(reach > 0)) return "";
  reach *= 1.1;
  const auto count = static_cast<double>(corrections.names.size());
  StaticChart chart(420, 50 + 18 * count, {"correction, " + corrections.unit, -reach, reach},
                    {"", count, 0, false, false}, 110);
  chart.Line({{0, 0}, {0, count}}, "dim", 1);
  for (size_t i = 0; i < corrections.names.size(); ++i) {
    const double y = static_cast<double>(i) + 0.5;
    const double value = corrections.values[i];
    chart.RowName(y, corrections.names[i]);
    chart.Line({{value - corrections.sigmas[i], y}, {value + corrections.sigmas[i], y}}, "first", 2);
    chart.Dot(value, y, 3.5, "first");
  }
  return chart.Svg();
}

std::string CorrectionsFigure(const RobotSummary& robot) {
  Json panels = Json::array();
  std::string pictures;
  for (const Corrections& corrections : CorrectionsOfArm(robot)) {
    panels.push_back(Json{{"unit", corrections.unit},
                          {"names", corrections.names},
                          {"values", corrections.values},
                          {"sigmas", corrections.sigmas}});
    pictures += CorrectionsChart(corrections);
  }
  return ViewFigure("arm-corrections", "Corrections of the arm's parameters, with one sigma to both sides.",
                    Json{{"panels", panels}}, "<div class=\"charts\">" + pictures + "</div>");
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
    const auto param = static_cast<ArmParam>(place % kNumArmParams);
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

// One chart of a map: the correction, or its uncertainty.
struct MapChart {
  std::string what;
  std::string colour;
  double ArmMap::Cell::*value;
};
const MapChart kMapCharts[] = {{"correction", "first", &ArmMap::Cell::correction_m},
                               {"sigma", "second", &ArmMap::Cell::sigma_m}};

std::pair<double, double> InSliceMm(const ArmMap& map, const Eigen::Vector3d& place_m) {
  return {1000 * place_m[0], 1000 * place_m[map.vertical_axis]};
}

// A range of coordinates, mm.
struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
};

// Returns the range of one coordinate (0 or 1) of the cells and captures of maps.
Range RangeOf(const std::vector<ArmMap>& maps, int coordinate) {
  Range range;
  for (const ArmMap& map : maps) {
    const auto add = [&](const Eigen::Vector3d& place_m, double margin_mm) {
      const auto [x, y] = InSliceMm(map, place_m);
      const double value = coordinate == 0 ? x : y;
      range.low = std::min(range.low, value - margin_mm);
      range.high = std::max(range.high, value + margin_mm);
    };
    for (const ArmMap::Cell& cell : map.cells) add(cell.middle_m, 500 * map.step_m);
    for (const Eigen::Vector3d& place_m : map.captures_m) add(place_m, 0);
  }
  return range;
}

std::pair<double, double> RangeMm(const ArmMap& map, const MapChart& what) {
  const auto [least, most] =
      std::minmax_element(map.cells.begin(), map.cells.end(),
                          [&](const ArmMap::Cell& a, const ArmMap::Cell& b) { return a.*what.value < b.*what.value; });
  return {1000 * (*least).*what.value, 1000 * (*most).*what.value};
}

// The opacity grows with the value, between the least and the most of the chart.
double Opacity(double value, double least, double most) {
  constexpr double kFaintest = 0.08;
  return most > least ? kFaintest + (1 - kFaintest) * (value - least) / (most - least) : 0.5;
}

std::string StaticMap(const ArmMap& map, const MapChart& what, const Range& x_range) {
  const Range y_range = RangeOf({map}, 1);
  const auto [least, most] = RangeMm(map, what);
  const double half = 500 * map.step_m;
  constexpr double kSize = 285;
  constexpr double kLeft = 56;
  const double height = (kSize - kLeft - kChartRight) * (y_range.high - y_range.low) / (x_range.high - x_range.low) +
                        kChartTop + kChartBottom;
  StaticChart chart(kSize, height,
                    {"base x, mm; " + what.what + " " + Significant(least, 2) + " to " + Significant(most, 2) + " mm",
                     x_range.low, x_range.high},
                    {std::string("base ") + (map.vertical_axis == 1 ? "y" : "z") + ", mm", y_range.low, y_range.high},
                    kLeft);
  for (const ArmMap::Cell& cell : map.cells) {
    const auto [x, y] = InSliceMm(map, cell.middle_m);
    chart.Bar(x - half, y - half, x + 0.94 * half, y + 0.94 * half, what.colour,
              Opacity(1000 * cell.*what.value, least, most));
  }
  for (const Eigen::Vector3d& place : map.captures_m) {
    chart.Dot(1000 * place[0], 1000 * place[map.vertical_axis], 2, "ink");
  }
  return chart.Svg();
}

double Rounded(double value, double power) { return std::round(value * power) / power; }

Json MapJson(const ArmMap& map) {
  Json cells = Json::array();
  for (const ArmMap::Cell& cell : map.cells) {
    const auto [x, y] = InSliceMm(map, cell.middle_m);
    cells.push_back(
        {Rounded(x, 10), Rounded(y, 10), Rounded(1000 * cell.correction_m, 1e4), Rounded(1000 * cell.sigma_m, 1e4)});
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
  const Range x_range = RangeOf(maps, 0);
  Json data{{"x", {Rounded(x_range.low, 10), Rounded(x_range.high, 10)}}, {"maps", Json::array()}};
  std::string pictures;
  for (const ArmMap& map : maps) {
    data["maps"].push_back(MapJson(map));
    for (const MapChart& what : kMapCharts) pictures += StaticMap(map, what, x_range);
  }
  const std::string& configuration = maps.front().configuration;
  return ViewFigure(
      "arm-map",
      "Distance between the stated and the true position of the gripper (correction), and one sigma of the true "
      "position relative to " +
          fixed + ": through the mean position of the captures, in their mean orientation" +
          (configuration.empty() ? "" : " and in the configuration " + configuration) +
          ". Dots are captures; the arm does not reach the blank positions.",
      data, "<div class=\"charts\">" + pictures + "</div>");
}

// Returns the poses of an arm in the captures that were used.
std::vector<Rigid3d> UsedPoses(const RigResult& result, size_t robot_index) {
  std::vector<Rigid3d> base_from_gripper;
  for (const RigCaptureResult& capture : result.captures) {
    const bool is_used = std::any_of(result.images.begin(), result.images.end(), [&](const RigImageResult& image) {
      return image.used && image.capture == capture.name;
    });
    if (is_used) base_from_gripper.push_back(capture.base_from_gripper[robot_index]);
  }
  return base_from_gripper;
}

std::string ArmSection(const RigResult& result, size_t robot_index) {
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
