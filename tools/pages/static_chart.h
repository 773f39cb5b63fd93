// Charts as static SVG, for readers of a page whose script does not run.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace heba {

struct ChartAxis {
  std::string label;
  double low = 0;
  double high = 1;
  bool is_log = false;
  bool has_ticks = true;
};

// The margins of a chart except the left one, px. Charts that are to be true to scale account for them.
inline constexpr double kChartTop = 8;
inline constexpr double kChartRight = 12;
inline constexpr double kChartBottom = 38;

// A chart whose marks are in the units of its axes. Colours are names of the page's style sheet: first, second, dim,
// ink, line, bad.
class StaticChart {
 public:
  // `width` and `height` are the size in px where there is enough room; `left` is the margin for the labels of the
  // vertical axis. The vertical axis runs upwards from `low` to `high`; `low` may be the larger one.
  StaticChart(double width, double height, ChartAxis x, ChartAxis y, double left = 56);

  void Dot(double x, double y, double radius_px, const std::string& colour);
  void Line(const std::vector<std::pair<double, double>>& points, const std::string& colour, double width_px,
            bool is_dashed = false);
  void Bar(double x1, double y1, double x2, double y2, const std::string& colour, double opacity = 1);
  // Adds text at a position; `anchor` is "start", "middle" or "end".
  void Text(double x, double y, const std::string& text, const std::string& anchor);
  // Adds text in the left margin at height y.
  void RowName(double y, const std::string& text);

  // Returns the markup of the chart.
  std::string Svg() const;

 private:
  double X(double x) const;
  double Y(double y) const;

  double width_;
  double height_;
  double left_;
  ChartAxis x_;
  ChartAxis y_;
  std::string marks_;
};

// One row of a dumbbell chart: two values on a logarithmic axis that are joined by a line. Values that are not
// positive and rows without values are omitted; the chart is empty if no row remains.
struct FigureRow {
  std::string label;
  std::optional<double> first;
  std::optional<double> second;
};
std::string DumbbellChart(const std::string& axis, const std::vector<FigureRow>& rows);

// Returns tick positions: 1, 2 and 5 of each decade of a logarithmic axis, or powers of ten only if it spans many
// decades; on a linear axis, at most `most` even steps.
std::vector<double> AxisTicks(const ChartAxis& axis, int most);

}  // namespace heba
