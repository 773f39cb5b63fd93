#include "tools/pages/report_charts.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>

#include "heba/base/text.h"
#include "tools/pages/static_chart.h"

namespace heba {
namespace {

constexpr double kWidth = 560;
constexpr size_t kMostMarks = 1500;

struct Residual {
  double x;
  double y;
  double dx;
  double dy;
};

std::vector<Residual> ResidualsOf(const CameraResiduals& camera) {
  std::vector<Residual> all;
  for (const ReportedImage& view : camera.images) {
    for (Eigen::Index i = 0; i < view.pixels.cols(); ++i) {
      all.push_back({view.pixels(0, i), view.pixels(1, i), view.residuals(0, i), view.residuals(1, i)});
    }
  }
  return all;
}

std::vector<Residual> Thinned(const std::vector<Residual>& all) {
  const size_t step = std::max<size_t>(1, (all.size() + kMostMarks - 1) / kMostMarks);
  std::vector<Residual> some;
  for (size_t i = 0; i < all.size(); i += step) some.push_back(all[i]);
  return some;
}

// Returns the length for which arrows are magnified: the median or, if a part of the lengths is much larger, a third of
// their 95th percentile, so that these do not cover the image. Normal noise has the ratio 2.1.
double TypicalLength(std::vector<double> lengths) {
  std::sort(lengths.begin(), lengths.end());
  return std::max(lengths[lengths.size() / 2], lengths[lengths.size() * 95 / 100] / 3);
}

// Returns an empty chart in pixel coordinates, y downwards.
StaticChart OverImage(const Camera& camera) {
  // The plot area has the aspect ratio of the image.
  constexpr double kLeft = 12;
  const double height = (kWidth - kLeft - kChartRight) * camera.height_px / camera.width_px;
  return {kWidth,
          height + kChartTop + kChartBottom,
          {"", -0.5, camera.width_px - 0.5, false, false},
          {"", camera.height_px - 0.5, -0.5, false, false},
          kLeft};
}

}  // namespace

std::string MethodsChart(const RunResult& result) {
  std::vector<FigureRow> rows;
  for (const Estimate& estimate : result.estimates) {
    if (!estimate.ok) continue;
    rows.push_back({estimate.method, estimate.errors.reprojection_rms_px, estimate.errors.holdout_rms_px});
  }
  return DumbbellChart("RMS in px: in-sample (first colour), hold-out (second)", rows);
}

std::string ResidualFieldChart(const CameraResiduals& residuals) {
  const Camera& camera = residuals.camera;
  const std::vector<Residual> drawn = Thinned(ResidualsOf(residuals));
  if (drawn.empty()) return "";
  std::vector<double> lengths;
  for (const Residual& r : drawn) lengths.push_back(std::hypot(r.dx, r.dy));
  const double times = camera.width_px / 40.0 / std::max(TypicalLength(std::move(lengths)), 1e-9);
  StaticChart chart = OverImage(camera);
  for (const Residual& r : drawn) {
    chart.Line({{r.x, r.y}, {r.x + times * r.dx, r.y + times * r.dy}}, "second", 1);
    chart.Dot(r.x, r.y, 1.2, "first");
  }
  return chart.Svg();
}

std::string CoverageChart(const CameraResiduals& residuals) {
  const Camera& camera = residuals.camera;
  const std::vector<Residual> all = ResidualsOf(residuals);
  if (all.empty()) return "";
  constexpr int kColumns = 8;
  const int rows =
      std::max(1, static_cast<int>(std::lround(static_cast<double>(kColumns) * camera.height_px / camera.width_px)));
  Eigen::MatrixXi counts = Eigen::MatrixXi::Zero(rows, kColumns);
  for (const Residual& r : all) {
    const int column = std::clamp(static_cast<int>((r.x + 0.5) / camera.width_px * kColumns), 0, kColumns - 1);
    const int row = std::clamp(static_cast<int>((r.y + 0.5) / camera.height_px * rows), 0, rows - 1);
    ++counts(row, column);
  }
  StaticChart chart = OverImage(camera);
  const double width = static_cast<double>(camera.width_px) / kColumns;
  const double height = static_cast<double>(camera.height_px) / rows;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const double x = -0.5 + width * column;
      const double y = -0.5 + height * row;
      chart.Bar(x, y, x + 0.97 * width, y + 0.97 * height, "first",
                0.85 * std::sqrt(static_cast<double>(counts(row, column)) / counts.maxCoeff()));
      const double percent = 100.0 * counts(row, column) / static_cast<double>(all.size());
      chart.Text(x + 0.5 * width, y + 0.5 * height, counts(row, column) == 0 ? "none" : Significant(percent, 2),
                 "middle");
    }
  }
  return chart.Svg();
}

std::string ResidualRadiusChart(const CameraResiduals& residuals) {
  const Camera& camera = residuals.camera;
  std::vector<std::pair<double, double>> dots;
  double farthest = 1;
  double largest = 1e-9;
  for (const Residual& r : Thinned(ResidualsOf(residuals))) {
    const double u = r.x - camera.params[2];
    const double v = r.y - camera.params[3];
    const double radius = std::hypot(u, v);
    const double outward = radius > 0 ? (u * r.dx + v * r.dy) / radius : 0;
    dots.emplace_back(radius, outward);
    farthest = std::max(farthest, radius);
    largest = std::max(largest, std::abs(outward));
  }
  if (dots.empty()) return "";
  StaticChart chart(kWidth, 240, {"distance from the principal point, px", 0, farthest},
                    {"radial residual, px", -largest, largest});
  for (const auto& [radius, outward] : dots) chart.Dot(radius, outward, 1.3, "first");
  return chart.Svg();
}

std::string HistogramChart(const CameraResiduals& residuals) {
  const double sigma_px = residuals.sigma_px;
  const std::vector<Residual> all = ResidualsOf(residuals);
  if (all.empty() || !(sigma_px > 0)) return "";
  constexpr int kBins = 41;
  const double reach = 5 * sigma_px;
  const double width = 2 * reach / kBins;
  std::array<int, kBins> counts{};
  for (const Residual& r : all) {
    for (const double value : {r.dx, r.dy}) {
      ++counts[static_cast<size_t>(std::clamp((value + reach) / width, 0.0, kBins - 1.0))];
    }
  }
  const double top = 2.0 * static_cast<double>(all.size()) * width / (sigma_px * std::sqrt(2 * M_PI));
  StaticChart chart(kWidth, 240, {"predicted minus observed, px", -reach, reach},
                    {"number of coordinates", 0,
                     1.05 * std::max(top, static_cast<double>(*std::max_element(counts.begin(), counts.end())))});
  for (size_t i = 0; i < counts.size(); ++i) {
    const double x = -reach + width * static_cast<double>(i);
    chart.Bar(x, 0, x + 0.93 * width, counts[i], "first", 0.7);
  }
  std::vector<std::pair<double, double>> normal;
  for (int i = 0; i <= 100; ++i) {
    const double x = -reach + 2 * reach * i / 100;
    normal.emplace_back(x, top * std::exp(-0.5 * std::pow(x / sigma_px, 2)));
  }
  chart.Line(normal, "second", 2);
  return chart.Svg();
}

std::string CaptureBarsChart(const CameraResiduals& residuals) {
  const std::vector<ReportedImage>& images = residuals.images;
  double largest = 0;
  for (const ReportedImage& image : images) largest = std::max(largest, image.rms_px.value_or(0));
  if (!(largest > 0)) return "";
  StaticChart chart(kWidth, 200, {"capture number", 0.5, static_cast<double>(images.size()) + 0.5},
                    {"rms, px", 0, 1.05 * largest});
  for (size_t i = 0; i < images.size(); ++i) {
    const double x = static_cast<double>(i) + 1;
    chart.Bar(x - 0.4, 0, x + 0.4, images[i].rms_px.value_or(0), "first");
  }
  return chart.Svg();
}

std::string EllipseChart(const std::string& x, const std::string& y, const Eigen::Matrix2d& covariance,
                         double reach_95) {
  const double largest = std::sqrt(covariance.diagonal().maxCoeff());
  if (!(largest > 0)) return "";
  const double reach = 1.1 * reach_95 * largest;
  constexpr double kSize = 250;
  constexpr double kLeft = 56;
  StaticChart chart(kSize, kSize - kLeft - kChartRight + kChartTop + kChartBottom, {x, -reach, reach},
                    {y, -reach, reach});
  const Eigen::Matrix2d root = covariance.llt().matrixL();
  for (const double sigmas : {1.0, reach_95}) {
    std::vector<std::pair<double, double>> outline;
    for (int i = 0; i <= 72; ++i) {
      const double angle = 2 * M_PI * i / 72;
      const Eigen::Vector2d place = sigmas * root * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      outline.emplace_back(place.x(), place.y());
    }
    chart.Line(outline, "first", sigmas > 1 ? 1 : 2, sigmas > 1);
  }
  return chart.Svg();
}

std::string CorrelationChart(const std::vector<std::string>& names, const Eigen::MatrixXd& correlation) {
  const auto count = static_cast<double>(names.size());
  constexpr double kCell = 20;
  constexpr double kCharacter = 7;
  double margin = 110;
  for (const std::string& name : names) margin = std::max(margin, kCharacter * static_cast<double>(name.size()));
  StaticChart chart(margin + kCell * count + 12, kCell * count + 46,
                    {"same order from left to right", 0, count, false, false}, {"", count, 0, false, false}, margin);
  for (size_t i = 0; i < names.size(); ++i) {
    chart.RowName(static_cast<double>(i) + 0.5, names[i]);
    for (size_t j = 0; j < names.size(); ++j) {
      const double value = correlation(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
      const double x = static_cast<double>(j);
      const double y = static_cast<double>(i);
      chart.Bar(x, y, x + 0.94, y + 0.94, value < 0 ? "first" : "second", std::min(1.0, std::abs(value)));
    }
  }
  return chart.Svg();
}

}  // namespace heba
