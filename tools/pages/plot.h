// Line plots as SVG text with two logarithmic axes.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace heba {

struct PlotLine {
  std::string name;
  std::vector<std::pair<double, double>> points;  // x ascending; points with values <= 0 are omitted.
  bool is_reference = false;                      // Drawn dashed and grey.
  bool is_emphasised = false;
};

struct Plot {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<PlotLine> lines;
};

// Returns a whole SVG document in light or dark colours, as the reader prefers, with each line's name next to its
// end.
std::string LogLogSvg(const Plot& plot);

}  // namespace heba
