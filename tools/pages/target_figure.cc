#include "tools/pages/target_figure.h"

#include <algorithm>
#include <vector>

#include "heba/base/text.h"
#include "tools/pages/page.h"

namespace heba {
namespace {

// A deviation with a probability below this is drawn strong.
constexpr double kClear = 1e-3;
constexpr double kWidth = 560;
constexpr double kMargin = 40;

// Returns the picture of one target: an arrow for each point's deviation in the plane of the target, and a disc as
// large as that out of it.
std::string PictureOf(const std::vector<PointDeviation>& points) {
  Eigen::Vector2d low = points.front().designed_m.head<2>();
  Eigen::Vector2d high = low;
  double largest_m = 0;
  for (const PointDeviation& one : points) {
    low = low.cwiseMin(one.designed_m.head<2>());
    high = high.cwiseMax(one.designed_m.head<2>());
    largest_m = std::max(largest_m, one.deviation_m.norm());
  }
  const double size_m = (high - low).maxCoeff();
  if (!(size_m > 0) || !(largest_m > 0)) return "";
  const double pixels_per_m = (kWidth - 2 * kMargin) / size_m;
  const double height = 2 * kMargin + pixels_per_m * (high.y() - low.y());
  constexpr double kLongest = 30;
  const double per_deviation = kLongest / largest_m;
  std::string svg = "<svg viewBox=\"0 0 " + Fixed(kWidth, 0) + " " + Fixed(height, 0) +
                    "\" role=\"img\" aria-label=\"deviations of the target's points\" style=\"max-width:560px;"
                    "width:100%;height:auto\">";
  for (const PointDeviation& one : points) {
    const Eigen::Vector2d at = (one.designed_m.head<2>() - low) * pixels_per_m + Eigen::Vector2d::Constant(kMargin);
    const Eigen::Vector2d end = at + per_deviation * one.deviation_m.head<2>();
    const std::string colour = one.deviation_m.z() < 0 ? "rgb(37,99,235)" : "rgb(194,65,12)";
    const std::string strength = one.p_value < kClear ? "1" : "0.35";
    svg += "<g opacity=\"" + strength + "\"><title>point " + std::to_string(one.id) + ": " +
           Fixed(1000 * one.deviation_m.x(), 3) + ", " + Fixed(1000 * one.deviation_m.y(), 3) + ", " +
           Fixed(1000 * one.deviation_m.z(), 3) + " mm (p = " + ShownPValue(one.p_value) + ")</title>";
    svg += "<circle cx=\"" + Fixed(at.x(), 1) + "\" cy=\"" + Fixed(at.y(), 1) + "\" r=\"" +
           Fixed(1.5 + 0.35 * per_deviation * std::abs(one.deviation_m.z()), 1) + "\" fill=\"" + colour +
           "\" fill-opacity=\"0.5\"/>";
    svg += "<line x1=\"" + Fixed(at.x(), 1) + "\" y1=\"" + Fixed(at.y(), 1) + "\" x2=\"" + Fixed(end.x(), 1) +
           "\" y2=\"" + Fixed(end.y(), 1) + "\" stroke=\"currentColor\" stroke-width=\"1.5\"/></g>";
  }
  return svg + "</svg>" +
         Paragraph("The longest arrow is " + Significant(1000 * largest_m, 2) +
                   " mm. Arrows are deviations along the target's x (to the right) and y (down), discs those along z: "
                   "orange towards positive z, blue towards negative. Points that deviate beyond chance are drawn "
                   "strong.");
}

}  // namespace

std::string TargetFigures(const ReportData& data) {
  std::string figures;
  for (size_t t = 0; t < data.result.rig.targets.size(); ++t) {
    std::vector<PointDeviation> points;
    const std::vector<PointOffsets>& offsets = data.result.point_offsets;
    const PointOffsets estimated = t < offsets.size() ? offsets[t] : PointOffsets();
    for (const PointDeviation& one : data.result.point_deviations) {
      if (one.target != t) continue;
      points.push_back(one);
      const auto offset = estimated.find(one.id);
      // An offset that was estimated is no residual any more.
      if (offset != estimated.end()) points.back().deviation_m = offset->second;
      if (offset != estimated.end()) points.back().p_value = 0;
    }
    const bool has_any =
        std::any_of(points.begin(), points.end(), [](const PointDeviation& one) { return one.p_value < kClear; });
    if (!has_any) continue;
    const std::string& name = data.result.rig.targets[t].name;
    if (!name.empty()) figures += Paragraph("Target " + name + ":");
    figures += PictureOf(points);
  }
  return figures;
}

}  // namespace heba
