// Charts as pictures in a page: what its script draws, for a reader who has no script.
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

// One chart, its marks in the axes' units. Colours are names of the page's own: first, second, dim, ink, line, bad.
// The margins of a chart but for that at the left, px: a chart that is to be true to scale counts them.
inline constexpr double kChartTop = 8;
inline constexpr double kChartRight = 12;
inline constexpr double kChartBottom = 38;

class StaticChart {
 public:
  // The size in px that it is drawn at where there is room; `left` is the margin beside the vertical axis. The vertical
  // axis runs upwards, from low to high; low may be the larger one.
  StaticChart(double width, double height, ChartAxis x, ChartAxis y, double left = 56);

  void Dot(double x, double y, double radius_px, const std::string& colour);
  void Line(const std::vector<std::pair<double, double>>& points, const std::string& colour, double width_px,
            bool is_dashed = false);
  void Bar(double x1, double y1, double x2, double y2, const std::string& colour, double opacity = 1);
  // Text at a place, `anchor` start, middle or end.
  void Text(double x, double y, const std::string& text, const std::string& anchor);
  // Text in the margin at the left of the height y.
  void RowName(double y, const std::string& text);

  // Markup.
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

// A row an entry: two figures on a logarithmic axis, and the line between them. Figures that are not positive, and rows
// without any, are left out. Empty if nothing is left.
struct FigureRow {
  std::string label;
  std::optional<double> first;
  std::optional<double> second;
};
std::string DumbbellChart(const std::string& axis, const std::vector<FigureRow>& rows);

// 1, 2 and 5 of each decade of a logarithmic axis; of many decades the ones alone; of a linear one some even steps.
std::vector<double> AxisTicks(const ChartAxis& axis, int most);

}  // namespace heba
