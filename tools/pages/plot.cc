#include "tools/pages/plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "heba/base/text.h"
#include "tools/pages/page.h"

namespace heba {
namespace {

constexpr double kWidth = 720;
constexpr double kHeight = 460;
constexpr double kLeft = 70;
constexpr double kRight = 120;
constexpr double kTop = 40;
constexpr double kBottom = 55;

// Colours that are distinct for most kinds of colour vision (after Okabe and Ito 2008, and Tol's muted scheme).
constexpr std::array<const char*, 12> kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9",
                                                  "#8a6d3b", "#6a3d9a", "#999933", "#882255", "#44aa99", "#dd5577"};

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void Add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  // Widens a range of base-10 logarithms to at least a third of a decade, with a margin at both ends.
  Range Widened() const {
    const double extra = std::max(0.05 * (high - low), (0.3 - (high - low)) / 2);
    return {low - std::max(0.05, extra), high + std::max(0.05, extra)};
  }
};

std::string Text(double x, double y, const std::string& attributes, const std::string& text) {
  return "<text x=\"" + Fixed(x, 1) + "\" y=\"" + Fixed(y, 1) + "\" " + attributes + ">" + EscapedForMarkup(text) +
         "</text>\n";
}

std::string Line(double x1, double y1, double x2, double y2, const std::string& style) {
  return "<line x1=\"" + Fixed(x1, 1) + "\" y1=\"" + Fixed(y1, 1) + "\" x2=\"" + Fixed(x2, 1) + "\" y2=\"" +
         Fixed(y2, 1) + "\" class=\"" + style + "\"/>\n";
}

// Returns 1, 2 and 5 of each decade, or powers of ten only if the range spans many decades.
std::vector<double> Ticks(const Range& log_range) {
  std::vector<double> ticks;
  const bool many = log_range.high - log_range.low > 4;
  for (int decade = static_cast<int>(std::floor(log_range.low)); decade <= std::ceil(log_range.high); ++decade) {
    for (const double step : {1.0, 2.0, 5.0}) {
      if (many && step != 1.0) continue;
      const double value = step * std::pow(10, decade);
      if (std::log10(value) >= log_range.low && std::log10(value) <= log_range.high) ticks.push_back(value);
    }
  }
  return ticks;
}

}  // namespace

std::string LogLogSvg(const Plot& plot) {
  Range x_data;
  Range y_data;
  for (const PlotLine& line : plot.lines) {
    for (const auto& [x, y] : line.points) {
      if (!(x > 0 && y > 0)) continue;
      x_data.Add(std::log10(x));
      y_data.Add(std::log10(y));
    }
  }
  std::string svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + Fixed(kWidth, 0) + " " +
                    Fixed(kHeight, 0) + "\" width=\"" + Fixed(kWidth, 0) +
                    "\" font-family=\"sans-serif\" font-size=\"12\">\n" +
                    "<style>.bg{fill:#fff}text{fill:#222}.axis{stroke:#222}.grid{stroke:#ddd}"
                    ".reference{stroke:#777;stroke-dasharray:6 4}"
                    "@media(prefers-color-scheme:dark){.bg{fill:#181a1b}text{fill:#ddd}.axis{stroke:#ddd}"
                    ".grid{stroke:#383c3e}}</style>\n" +
                    "<rect class=\"bg\" width=\"100%\" height=\"100%\"/>\n" +
                    Text(kLeft, 22, "font-size=\"14\" font-weight=\"bold\"", plot.title);
  if (!(x_data.low <= x_data.high)) return svg + Text(kLeft, 60, "", "nothing to draw") + "</svg>\n";
  const Range x_range = x_data.Widened();
  const Range y_range = y_data.Widened();
  const double plot_width = kWidth - kLeft - kRight;
  const double plot_height = kHeight - kTop - kBottom;
  const auto x_of = [&](double x) {
    return kLeft + plot_width * (std::log10(x) - x_range.low) / (x_range.high - x_range.low);
  };
  const auto y_of = [&](double y) {
    return kTop + plot_height * (y_range.high - std::log10(y)) / (y_range.high - y_range.low);
  };
  for (const double tick : Ticks(x_range)) {
    svg += Line(x_of(tick), kTop, x_of(tick), kTop + plot_height, "grid");
    svg += Text(x_of(tick), kTop + plot_height + 18, "text-anchor=\"middle\"", Significant(tick, 2));
  }
  for (const double tick : Ticks(y_range)) {
    svg += Line(kLeft, y_of(tick), kLeft + plot_width, y_of(tick), "grid");
    svg += Text(kLeft - 8, y_of(tick) + 4, "text-anchor=\"end\"", Significant(tick, 2));
  }
  svg += Line(kLeft, kTop + plot_height, kLeft + plot_width, kTop + plot_height, "axis");
  svg += Line(kLeft, kTop, kLeft, kTop + plot_height, "axis");
  svg += Text(kLeft + plot_width / 2, kHeight - 14, "text-anchor=\"middle\"", plot.x_label);
  svg += Text(0, 0,
              "text-anchor=\"middle\" transform=\"translate(18," + Fixed(kTop + plot_height / 2, 1) + ") rotate(-90)\"",
              plot.y_label);

  // The names at the ends of the lines are moved apart where they would overlap.
  struct Label {
    double y;
    std::string colour;
    std::string name;
  };
  std::vector<Label> labels;
  size_t colour = 0;
  for (const PlotLine& line : plot.lines) {
    const std::string stroke = line.is_reference ? "#777" : kColours[colour++ % kColours.size()];
    std::string path;
    double end_y = 0;
    for (const auto& [x, y] : line.points) {
      if (!(x > 0 && y > 0)) continue;
      path += (path.empty() ? "" : " ") + Fixed(x_of(x), 1) + "," + Fixed(y_of(y), 1);
      end_y = y_of(y);
      if (!line.is_reference) {
        svg += "<circle cx=\"" + Fixed(x_of(x), 1) + "\" cy=\"" + Fixed(y_of(y), 1) + "\" r=\"3\" fill=\"" + stroke +
               "\"/>\n";
      }
    }
    if (path.empty()) continue;
    svg += "<polyline fill=\"none\" points=\"" + path + "\"" +
           (line.is_reference ? " class=\"reference\"" : " stroke=\"" + stroke + "\"") + " stroke-width=\"" +
           (line.is_emphasised ? "3" : "1.5") + "\"/>\n";
    labels.push_back({end_y, stroke, line.name});
  }
  std::sort(labels.begin(), labels.end(), [](const Label& a, const Label& b) { return a.y < b.y; });
  constexpr double kLineHeight = 14;
  for (size_t i = 1; i < labels.size(); ++i) labels[i].y = std::max(labels[i].y, labels[i - 1].y + kLineHeight);
  // Names that were pushed below the chart move up again.
  double lowest = kTop + plot_height;
  for (size_t i = labels.size(); i-- > 0;) {
    labels[i].y = std::min(labels[i].y, lowest);
    lowest = labels[i].y - kLineHeight;
  }
  for (const Label& label : labels) {
    svg += Text(kLeft + plot_width + 8, label.y + 4, "style=\"fill:" + label.colour + "\"", label.name);
  }
  return svg + "</svg>\n";
}

}  // namespace heba
