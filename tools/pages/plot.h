// Line plots as SVG text, both axes logarithmic.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace heba {

struct PlotLine {
  std::string name;
  std::vector<std::pair<double, double>> points;  // x ascending; values that are not positive are left out.
  bool is_reference = false;                      // Drawn dashed and grey.
  bool is_emphasised = false;
};

struct Plot {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<PlotLine> lines;
};

// A whole document, light and dark by the reader's preference; names beside the lines' ends.
std::string LogLogSvg(const Plot& plot);

}  // namespace heba
