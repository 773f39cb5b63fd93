#include "tools/pages/residual_sections.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <set>

#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "tools/pages/page.h"
#include "tools/pages/page_numbers.h"
#include "tools/pages/report_charts.h"

namespace heba {
namespace {

using Json = nlohmann::ordered_json;

// Returns the images that are embedded. Images make a page large, so at most 100 are embedded: unused ones first, then
// those with the largest RMS.
std::set<std::string> ImagesToShow(const CameraResiduals& residuals) {
  constexpr size_t kMaxImages = 100;
  std::vector<const CameraResiduals::Image*> order;
  for (const CameraResiduals::Image& image : residuals.images) order.push_back(&image);
  std::stable_sort(order.begin(), order.end(), [](const CameraResiduals::Image* a, const CameraResiduals::Image* b) {
    if (a->used != b->used) return !a->used;
    return a->rms_px.value_or(0) > b->rms_px.value_or(0);
  });
  if (order.size() > kMaxImages) order.resize(kMaxImages);
  std::set<std::string> images;
  for (const CameraResiduals::Image* image : order) images.insert(image->name);
  return images;
}

// Returns x, y and the residual (predicted minus observed), px, of each point for which `keep` returns true.
Json PointsJson(const Points2& pixels, const Points2& residuals, const std::function<bool()>& keep) {
  Json points = Json::array();
  for (Eigen::Index i = 0; i < pixels.cols(); ++i) {
    if (!keep()) continue;
    for (const double value : {Rounded(pixels(0, i), 2), Rounded(pixels(1, i), 2), Rounded(residuals(0, i), 4),
                               Rounded(residuals(1, i), 4)}) {
      points.push_back(value);
    }
  }
  return points;
}

// Pages with more points would be too large; they hold an evenly spaced sample.
constexpr Eigen::Index kMaxPoints = 40'000;

Eigen::Index NumPoints(const CameraResiduals& residuals) {
  Eigen::Index num_points = 0;
  for (const CameraResiduals::Image& image : residuals.images) {
    if (image.shown != nullptr) num_points += image.shown->pixels.cols();
  }
  return num_points;
}

std::vector<ReportedCapture> ShownOf(const CameraResiduals& residuals) {
  std::vector<ReportedCapture> captures;
  for (const CameraResiduals::Image& image : residuals.images) {
    if (image.shown != nullptr) captures.push_back(*image.shown);
  }
  return captures;
}

}  // namespace

std::string PageSection(const std::string& heading, const std::string& content) {
  return "<section>" + Heading(heading) + content + "</section>\n";
}

std::string CorrelationSection(const Covariance& covariance) {
  constexpr Eigen::Index kMostNames = 80;
  if (covariance.matrix.rows() > kMostNames) return "";
  const Eigen::VectorXd scale = covariance.matrix.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd correlation = scale.asDiagonal() * covariance.matrix * scale.asDiagonal();
  const std::vector<std::string> names = covariance.layout.Names();
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < correlation.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < correlation.cols(); ++j) row.push_back(Rounded(correlation(i, j), 3));
    rows.push_back(row);
  }
  const std::string figure =
      ViewFigure("correlation", "Strong colours off the diagonal mark parameters that the captures cannot separate.",
                 Json{{"names", names}, {"matrix", rows}}, CorrelationChart(names, correlation));
  return figure.empty() ? "" : PageSection("Parameter correlation", figure);
}

std::string ResidualData(const std::string& name, const CameraResiduals& residuals) {
  // Multiples of the golden ratio modulo 1 sample evenly, whatever the order of the points on the target.
  const double share = std::min(1.0, static_cast<double>(kMaxPoints) / static_cast<double>(NumPoints(residuals)));
  double place = 0;
  const auto keep = [&] {
    place += std::numbers::phi;
    place -= std::floor(place);
    return place <= share;
  };
  const std::set<std::string> images = ImagesToShow(residuals);
  const Camera& camera = residuals.camera;
  Json data{{"image_size", {camera.width_px, camera.height_px}},
            {"centre", {camera.params[2], camera.params[3]}},
            {"rms_px", OrNull(residuals.rms_px)},
            {"sigma_px", residuals.sigma_px},
            {"captures", Json::array()}};
  for (const CameraResiduals::Image& image : residuals.images) {
    const ReportedCapture* const shown = image.shown;
    const bool has_image = shown != nullptr && !shown->small_jpeg.empty() && images.count(image.name) > 0;
    data["captures"].push_back(
        Json{{"image", image.name},
             {"title", image.title},
             {"used", image.used},
             {"reason", image.reason},
             {"rms_px", OrNull(image.rms_px)},
             {"points", shown != nullptr ? PointsJson(shown->pixels, shown->residuals, keep) : Json::array()},
             {"left_out",
              shown != nullptr ? PointsJson(shown->left_out_pixels, shown->left_out_residuals, keep) : Json::array()},
             {"picture", has_image ? Json(ToBase64(shown->small_jpeg)) : Json(nullptr)}});
  }
  return SharedData(name, data);
}

std::string ResidualSections(const std::string& name, const CameraResiduals& residuals) {
  const Camera& camera = residuals.camera;
  const std::vector<ReportedCapture> captures = ShownOf(residuals);
  const std::string sample =
      NumPoints(residuals) > kMaxPoints ? " An evenly spaced sample of the points is shown." : "";
  const std::string field = SharedViewFigure("residual-field",
                                             "Residuals (predicted minus observed) of the inliers" +
                                                 residuals.condition + ". Click to open the capture." + sample,
                                             name, ResidualFieldChart(camera, captures));
  if (field.empty()) return "";
  const std::string cells = SharedViewFigure(
      "coverage", "Percentage of the inliers. Cells without points do not constrain the lens model." + sample, name,
      CoverageChart(camera, captures));
  const std::string radius = SharedViewFigure("residual-radius", "", name, ResidualRadiusChart(camera, captures));
  const std::string histogram = SharedViewFigure(
      "histogram",
      "Residual coordinates of the inliers" + residuals.condition +
          ", and the normal distribution of the stated sigma. The outermost bars count all residuals beyond 5 sigma.",
      name, HistogramChart(residuals.sigma_px, captures));
  std::vector<std::optional<double>> rms_px;
  for (const CameraResiduals::Image& image : residuals.images) rms_px.push_back(image.rms_px);
  const std::string bars =
      SharedViewFigure("capture-bars",
                       "RMS of each image" + residuals.condition +
                           ". The dashed line is the RMS of all points. Click to open the capture.",
                       name, CaptureBarsChart(rms_px));
  return "<div class=\"columns\">\n" + PageSection("Residuals over the image", field) +
         PageSection("Image coverage", cells) + PageSection("Residuals by radius", radius) +
         PageSection("Residual histogram", histogram) + PageSection("Residuals by capture", bars) + "</div>\n";
}

}  // namespace heba
