// Charts as SVG markup within a page, in the page's own colours.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace heba {

// Two bars a line, on a logarithmic scale: what is not known has none.
struct BarLine {
  std::string label;
  std::optional<double> first;
  std::optional<double> second;
};
std::string BarChart(const std::vector<BarLine>& lines, const std::string& first_name, const std::string& second_name,
                     const std::string& unit);

// Arrows over a picture of `width_px` x `height_px`, drawn `scale` times as long as they are.
struct Arrow {
  Eigen::Vector2d at;
  Eigen::Vector2d along;
};
std::string ArrowField(double width_px, double height_px, const std::vector<Arrow>& arrows, double scale);

// Points of y against x, both from zero on.
std::string ScatterChart(const std::vector<Eigen::Vector2d>& points, const std::string& x_title,
                         const std::string& y_title);

// The ellipse that a normal distribution of this covariance fills with 39 % (one sigma), about the origin; axes in the
// covariance's unit.
std::string EllipseChart(const Eigen::Matrix2d& covariance, const std::string& x_title, const std::string& y_title);

// A square of coloured cells, from -1 to 1.
std::string CorrelationChart(const std::vector<std::string>& names, const Eigen::MatrixXd& correlation);

}  // namespace heba
