#include "tools/pages/static_chart.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "heba/base/text.h"

namespace heba {
namespace {

constexpr double kTop = kChartTop;
constexpr double kRight = kChartRight;
constexpr double kBottom = kChartBottom;

double Share(const ChartAxis& axis, double value) {
  if (axis.is_log) return std::log(value / axis.low) / std::log(axis.high / axis.low);
  return (value - axis.low) / (axis.high - axis.low);
}

// Formats without trailing zeros.
std::string TickText(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof(buffer), "%.6g", value);
  return buffer;
}

std::string Ink(const std::string& colour) { return "var(--" + colour + ")"; }

}  // namespace

std::vector<double> AxisTicks(const ChartAxis& axis, int most) {
  std::vector<double> ticks;
  const double low = std::min(axis.low, axis.high);
  const double high = std::max(axis.low, axis.high);
  if (axis.is_log) {
    const bool has_many = std::log10(high / low) > 3;
    for (int decade = static_cast<int>(std::floor(std::log10(low))); decade <= std::ceil(std::log10(high)); ++decade) {
      for (const double step : {1.0, 2.0, 5.0}) {
        const double value = step * std::pow(10, decade);
        if ((!has_many || step == 1.0) && value >= low && value <= high) ticks.push_back(value);
      }
    }
    return ticks;
  }
  const double power = std::pow(10, std::floor(std::log10((high - low) / most)));
  double step = 10 * power;
  for (const double factor : {5.0, 2.0, 1.0}) {
    if ((high - low) / (factor * power) <= most) step = factor * power;
  }
  for (double tick = std::ceil(low / step) * step; tick <= high + 1e-9 * step; tick += step) {
    ticks.push_back(std::abs(tick) < 1e-9 * step ? 0 : tick);
  }
  return ticks;
}

StaticChart::StaticChart(double width, double height, ChartAxis x, ChartAxis y, double left)
    : width_(width), height_(height), left_(left), x_(std::move(x)), y_(std::move(y)) {}

double StaticChart::X(double x) const { return left_ + (width_ - left_ - kRight) * Share(x_, x); }
double StaticChart::Y(double y) const { return kTop + (height_ - kTop - kBottom) * (1 - Share(y_, y)); }

void StaticChart::Dot(double x, double y, double radius_px, const std::string& colour) {
  marks_ += "<circle cx=\"" + Fixed(X(x), 1) + "\" cy=\"" + Fixed(Y(y), 1) + "\" r=\"" + Fixed(radius_px, 1) +
            "\" fill=\"" + Ink(colour) + "\"/>\n";
}

void StaticChart::Line(const std::vector<std::pair<double, double>>& points, const std::string& colour, double width_px,
                       bool is_dashed) {
  std::string path;
  for (const auto& [x, y] : points) path += (path.empty() ? "" : " ") + Fixed(X(x), 1) + "," + Fixed(Y(y), 1);
  marks_ += "<polyline fill=\"none\" points=\"" + path + "\" stroke=\"" + Ink(colour) + "\" stroke-width=\"" +
            Fixed(width_px, 1) + "\"" + (is_dashed ? " stroke-dasharray=\"6 4\"" : "") + "/>\n";
}

void StaticChart::Bar(double x1, double y1, double x2, double y2, const std::string& colour, double opacity) {
  const auto [left, right] = std::minmax({X(x1), X(x2)});
  const auto [top, bottom] = std::minmax({Y(y1), Y(y2)});
  marks_ += "<rect x=\"" + Fixed(left, 1) + "\" y=\"" + Fixed(top, 1) + "\" width=\"" + Fixed(right - left, 1) +
            "\" height=\"" + Fixed(bottom - top, 1) + "\" fill=\"" + Ink(colour) + "\"" +
            (opacity < 1 ? " fill-opacity=\"" + Fixed(opacity, 2) + "\"" : "") + "/>\n";
}

void StaticChart::Text(double x, double y, const std::string& text, const std::string& anchor) {
  marks_ += "<text x=\"" + Fixed(X(x), 1) + "\" y=\"" + Fixed(Y(y) + 4, 1) + "\" text-anchor=\"" + anchor + "\">" +
            EscapedForMarkup(text) + "</text>\n";
}

void StaticChart::RowName(double y, const std::string& text) {
  marks_ += "<text x=\"" + Fixed(left_ - 8, 1) + "\" y=\"" + Fixed(Y(y) + 4, 1) + "\" text-anchor=\"end\">" +
            EscapedForMarkup(text) + "</text>\n";
}

std::string StaticChart::Svg() const {
  const auto text = [](double x, double y, const std::string& attributes, const std::string& words) {
    return "<text x=\"" + Fixed(x, 1) + "\" y=\"" + Fixed(y, 1) + "\" " + attributes + ">" + EscapedForMarkup(words) +
           "</text>\n";
  };
  const auto grid = [](double x1, double y1, double x2, double y2) {
    return "<line x1=\"" + Fixed(x1, 1) + "\" y1=\"" + Fixed(y1, 1) + "\" x2=\"" + Fixed(x2, 1) + "\" y2=\"" +
           Fixed(y2, 1) + "\" stroke=\"var(--line)\"/>\n";
  };
  const double right = width_ - kRight;
  const double bottom = height_ - kBottom;
  std::string svg = "<svg class=\"picture\" viewBox=\"0 0 " + Fixed(width_, 0) + " " + Fixed(height_, 0) +
                    "\" width=\"" + Fixed(width_, 0) + "\" role=\"img\">\n";
  if (x_.has_ticks) {
    for (const double tick : AxisTicks(x_, width_ < 300 ? 3 : 8)) {
      svg +=
          grid(X(tick), kTop, X(tick), bottom) + text(X(tick), bottom + 15, "text-anchor=\"middle\"", TickText(tick));
    }
  }
  if (y_.has_ticks) {
    for (const double tick : AxisTicks(y_, height_ < 300 ? 4 : 6)) {
      svg += grid(left_, Y(tick), right, Y(tick)) + text(left_ - 6, Y(tick) + 4, "text-anchor=\"end\"", TickText(tick));
    }
  }
  svg += marks_ + text(0.5 * (left_ + right), height_ - 6, "text-anchor=\"middle\"", x_.label);
  if (!y_.label.empty()) {
    svg += text(
        0, 0, "text-anchor=\"middle\" transform=\"translate(12," + Fixed(0.5 * (kTop + bottom), 1) + ") rotate(-90)\"",
        y_.label);
  }
  return svg + "</svg>\n";
}

std::string DumbbellChart(const std::string& axis, const std::vector<FigureRow>& rows) {
  std::vector<FigureRow> shown;
  double low = std::numeric_limits<double>::infinity();
  double high = 0;
  for (FigureRow row : rows) {
    for (std::optional<double>* figure : {&row.first, &row.second}) {
      if (*figure && !(**figure > 0)) figure->reset();
      if (!*figure) continue;
      low = std::min(low, **figure);
      high = std::max(high, **figure);
    }
    if (row.first || row.second) shown.push_back(std::move(row));
  }
  if (shown.empty()) return "";
  constexpr size_t kLongest = 28;
  size_t longest = 0;
  for (FigureRow& row : shown) {
    row.label = ShortenedAtStart(row.label, kLongest);
    longest = std::max(longest, NumCharacters(row.label));
  }
  constexpr double kWidth = 620;
  constexpr double kPxPerLetter = 7;
  const auto count = static_cast<double>(shown.size());
  StaticChart chart(kWidth, 50 + 20 * count, {axis, low / 1.3, 1.3 * high, true}, {"", count, 0, false, false},
                    16 + kPxPerLetter * static_cast<double>(longest));
  for (size_t i = 0; i < shown.size(); ++i) {
    const double y = static_cast<double>(i) + 0.5;
    chart.RowName(y, shown[i].label);
    if (shown[i].first && shown[i].second) chart.Line({{*shown[i].first, y}, {*shown[i].second, y}}, "dim", 2);
    if (shown[i].second) chart.Dot(*shown[i].second, y, 5, "second");
    if (shown[i].first) chart.Dot(*shown[i].first, y, 5, "first");
  }
  return chart.Svg();
}

}  // namespace heba
