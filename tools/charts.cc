#include "tools/charts.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/page.h"

namespace heba {
namespace {

std::string N(double value) { return Fixed(value, 2); }

std::string Svg(double width, double height, const std::string& what, const std::string& body) {
  return "<svg viewBox=\"0 0 " + N(width) + " " + N(height) + "\" role=\"img\" aria-label=\"" + Escaped(what) +
         "\" style=\"max-width: " + N(width) + "px\">\n" + body + "</svg>\n";
}

std::string Text(double x, double y, const std::string& text, const std::string& anchor, const std::string& more = "") {
  return "<text x=\"" + N(x) + "\" y=\"" + N(y) + "\" text-anchor=\"" + anchor + "\"" + more + ">" + Escaped(text) +
         "</text>\n";
}

std::string Line(double x1, double y1, double x2, double y2, const std::string& kind) {
  return "<line class=\"" + kind + "\" x1=\"" + N(x1) + "\" y1=\"" + N(y1) + "\" x2=\"" + N(x2) + "\" y2=\"" + N(y2) +
         "\"/>\n";
}

// The next of 1, 2, 5 times a power of ten that is not below `value`.
double RoundUp(double value) {
  if (!(value > 0)) return 1;
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= value * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

}  // namespace

std::string BarChart(const std::vector<BarLine>& lines, const std::string& first_name, const std::string& second_name,
                     const std::string& unit) {
  double low = 1e300;
  double high = 0;
  for (const BarLine& line : lines) {
    for (const std::optional<double>& value : {line.first, line.second}) {
      if (!value || !(*value > 0)) continue;
      low = std::min(low, *value);
      high = std::max(high, *value);
    }
  }
  if (high <= 0) return "<p>no method has figures to show</p>\n";
  const double first_decade = std::floor(std::log10(low) - 0.1);
  const double last_decade = std::ceil(std::log10(high) + 0.02);
  constexpr double kLeft = 110;
  constexpr double kWidth = 560;
  constexpr double kStep = 30;
  const double bottom = 34 + kStep * static_cast<double>(lines.size());
  const auto x_of = [&](double value) {
    return kLeft + kWidth * (std::log10(value) - first_decade) / (last_decade - first_decade);
  };
  std::string body;
  for (double decade = first_decade; decade <= last_decade; ++decade) {
    const double x = x_of(std::pow(10, decade));
    body += Line(x, 28, x, bottom, "grid") + Text(x, bottom + 16, Significant(std::pow(10, decade), 1), "middle");
  }
  body += "<rect class=\"first\" x=\"110\" y=\"6\" width=\"12\" height=\"10\"/>\n" +
          Text(127, 15, first_name, "start") +
          "<rect class=\"second\" x=\"260\" y=\"6\" width=\"12\" height=\"10\"/>\n" +
          Text(277, 15, second_name, "start") + Text(kLeft + kWidth, 15, unit, "end");
  for (size_t i = 0; i < lines.size(); ++i) {
    const double y = 34 + kStep * static_cast<double>(i);
    body += Text(kLeft - 8, y + 15, lines[i].label, "end");
    int row = 0;
    for (const std::optional<double>& value : {lines[i].first, lines[i].second}) {
      if (value && *value > 0) {
        body += std::string("<rect class=\"") + (row == 0 ? "first" : "second") + "\" x=\"" + N(kLeft) + "\" y=\"" +
                N(y + 11 * row) + "\" width=\"" + N(x_of(*value) - kLeft) + "\" height=\"10\"><title>" +
                Escaped(lines[i].label + ": " + Significant(*value, 3) + " " + unit) + "</title></rect>\n";
      }
      ++row;
    }
  }
  return Svg(kLeft + kWidth + 30, bottom + 24, "methods compared", body);
}

std::string ArrowField(double width_px, double height_px, const std::vector<Arrow>& arrows, double scale) {
  constexpr double kWidth = 700;
  const double shrink = kWidth / width_px;
  std::string body =
      "<rect class=\"frame\" x=\"0\" y=\"0\" width=\"" + N(kWidth) + "\" height=\"" + N(shrink * height_px) + "\"/>\n";
  for (const Arrow& arrow : arrows) {
    const Eigen::Vector2d from = shrink * (arrow.at + Eigen::Vector2d(0.5, 0.5));
    const Eigen::Vector2d to = from + shrink * scale * arrow.along;
    body += Line(from.x(), from.y(), to.x(), to.y(), "arrow") + "<circle class=\"dot\" cx=\"" + N(from.x()) +
            "\" cy=\"" + N(from.y()) + "\" r=\"1\"/>\n";
  }
  return Svg(kWidth, shrink * height_px, "residuals over the picture", body);
}

std::string ScatterChart(const std::vector<Eigen::Vector2d>& points, const std::string& x_title,
                         const std::string& y_title) {
  Eigen::Vector2d high(0, 0);
  for (const Eigen::Vector2d& point : points) high = high.cwiseMax(point);
  const double x_max = RoundUp(high.x());
  const double y_max = RoundUp(high.y());
  constexpr double kLeft = 60;
  constexpr double kTop = 10;
  constexpr double kWidth = 600;
  constexpr double kHeight = 220;
  std::string body;
  for (int i = 0; i <= 4; ++i) {
    const double share = 0.25 * i;
    body += Line(kLeft, kTop + kHeight * (1 - share), kLeft + kWidth, kTop + kHeight * (1 - share), "grid") +
            Text(kLeft - 6, kTop + kHeight * (1 - share) + 4, Significant(share * y_max, 2), "end") +
            Text(kLeft + kWidth * share, kTop + kHeight + 16, Significant(share * x_max, 3), "middle");
  }
  for (const Eigen::Vector2d& point : points) {
    body += "<circle class=\"dot\" cx=\"" + N(kLeft + kWidth * point.x() / x_max) + "\" cy=\"" +
            N(kTop + kHeight * (1 - point.y() / y_max)) + "\" r=\"1.3\"/>\n";
  }
  body += Text(kLeft + kWidth, kTop + kHeight + 32, x_title, "end") + Text(kLeft + 4, kTop + 10, y_title, "start");
  return Svg(kLeft + kWidth + 30, kTop + kHeight + 40, y_title + " against " + x_title, body);
}

std::string EllipseChart(const Eigen::Matrix2d& covariance, const std::string& x_title, const std::string& y_title) {
  const double reach = RoundUp(1.1 * std::sqrt(std::max(covariance(0, 0), covariance(1, 1))));
  constexpr double kSize = 200;
  constexpr double kLeft = 46;
  const double scale = 0.5 * kSize / reach;
  const double middle_x = kLeft + 0.5 * kSize;
  const double middle_y = 8 + 0.5 * kSize;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(covariance);
  const Eigen::Vector2d axes = eigen.eigenvalues().cwiseMax(0).cwiseSqrt();
  const Eigen::Vector2d major = eigen.eigenvectors().col(1);
  // The picture's y points down.
  const double angle_deg = -RadToDeg(std::atan2(major.y(), major.x()));
  std::string body = "<rect class=\"frame\" x=\"46\" y=\"8\" width=\"200\" height=\"200\"/>\n" +
                     Line(kLeft, middle_y, kLeft + kSize, middle_y, "grid") +
                     Line(middle_x, 8, middle_x, 8 + kSize, "grid") + "<ellipse class=\"ellipse\" cx=\"" + N(middle_x) +
                     "\" cy=\"" + N(middle_y) + "\" rx=\"" + N(scale * axes[1]) + "\" ry=\"" + N(scale * axes[0]) +
                     "\" transform=\"rotate(" + N(angle_deg) + " " + N(middle_x) + " " + N(middle_y) + ")\"/>\n" +
                     Text(kLeft, 8 + kSize + 15, Significant(-reach, 2), "start") +
                     Text(kLeft + kSize, 8 + kSize + 15, Significant(reach, 2), "end") +
                     Text(middle_x, 8 + kSize + 15, x_title, "middle") +
                     Text(kLeft - 4, 18, Significant(reach, 2), "end") + Text(kLeft - 4, middle_y + 4, y_title, "end");
  return Svg(kLeft + kSize + 10, kSize + 30, "one sigma, " + x_title + " and " + y_title, body);
}

std::string CorrelationChart(const std::vector<std::string>& names, const Eigen::MatrixXd& correlation) {
  constexpr double kCell = 18;
  constexpr double kLeft = 130;
  const double size = kCell * static_cast<double>(names.size());
  std::string body;
  for (size_t i = 0; i < names.size(); ++i) {
    const double y = kCell * static_cast<double>(i);
    body += Text(kLeft - 6, y + 13, names[i], "end");
    for (size_t j = 0; j < names.size(); ++j) {
      const double value = correlation(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
      body += std::string("<rect class=\"") + (value < 0 ? "negative" : "positive") + "\" x=\"" +
              N(kLeft + kCell * static_cast<double>(j)) + "\" y=\"" + N(y) + "\" width=\"" + N(kCell - 1) +
              "\" height=\"" + N(kCell - 1) + "\" fill-opacity=\"" + N(std::min(1.0, std::abs(value))) + "\"><title>" +
              Escaped(names[i] + ", " + names[j] + ": " + Fixed(value, 3)) + "</title></rect>\n";
    }
  }
  return Svg(kLeft + size, size, "correlation of the parameters", body);
}

}  // namespace heba
