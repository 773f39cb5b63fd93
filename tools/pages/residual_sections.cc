#include "tools/pages/residual_sections.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "heba/base/text.h"
#include "tools/pages/page.h"
#include "tools/pages/page_numbers.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

using Json = nlohmann::ordered_json;

// Returns the images of a camera that are embedded, as indices. Images make a page large, so at most 100 are embedded:
// unused ones first, then those with the largest RMS.
std::set<size_t> ImagesToShow(const std::vector<ReportedImage>& images) {
  constexpr size_t kMaxImages = 100;
  constexpr double kUnusedFirst = std::numeric_limits<double>::infinity();
  std::vector<size_t> order(images.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return images[a].rms_px.value_or(kUnusedFirst) > images[b].rms_px.value_or(kUnusedFirst);
  });
  if (order.size() > kMaxImages) order.resize(kMaxImages);
  return {order.begin(), order.end()};
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

Eigen::Index NumPoints(const CameraResiduals& camera) {
  Eigen::Index num_points = 0;
  for (const ReportedImage& image : camera.images) num_points += image.pixels.cols();
  return num_points;
}

// Returns what the residuals are computed with; part of the captions.
std::string Condition(const ReportData& data) {
  return data.has_corrections ? " after the corrections of the arms" : "";
}

// States how the residuals of a camera compare with its noise.
std::string ResidualText(const ReportData& data, size_t c) {
  const CameraResiduals& camera = data.residuals[c];
  std::string text = "The RMS of the residuals is " + FigureText(camera.rms_px) + " px" + Condition(data);
  if (data.has_corrections) {
    text +=
        ", and " + FigureText(data.result.errors[c].reprojection_rms_px) + " px with the poses as the arms report them";
  }
  return text + "; the pixel noise is " + Significant(camera.sigma_px, 3) +
         " px (one sigma of a coordinate; the RMS of points with this noise is 1.4 times as large).";
}

// Returns the data of the views and of the dialog of an image.
std::string ResidualData(const ReportData& report, size_t c) {
  const CameraResiduals& of_camera = report.residuals[c];
  // Multiples of the golden ratio modulo 1 sample evenly, whatever the order of the points on the target.
  const double share = std::min(1.0, static_cast<double>(kMaxPoints) / static_cast<double>(NumPoints(of_camera)));
  double place = 0;
  const auto keep = [&] {
    place += std::numbers::phi;
    place -= std::floor(place);
    return place <= share;
  };
  const std::set<size_t> pictures = ImagesToShow(of_camera.images);
  const Camera& camera = of_camera.camera;
  Json data{{"image_size", {camera.width_px, camera.height_px}},
            {"centre", {camera.params[2], camera.params[3]}},
            {"rms_px", OrNull(of_camera.rms_px)},
            {"sigma_px", of_camera.sigma_px},
            {"captures", Json::array()}};
  for (size_t i = 0; i < of_camera.images.size(); ++i) {
    const ReportedImage& image = of_camera.images[i];
    const ImageResult& entry = report.result.images[image.entry];
    const bool has_picture = !image.small_jpeg.empty() && pictures.contains(i);
    data["captures"].push_back(Json{{"image", entry.capture},
                                    {"title", image.title},
                                    {"used", entry.used},
                                    {"reason", entry.reason},
                                    {"rms_px", OrNull(image.rms_px)},
                                    {"points", PointsJson(image.pixels, image.residuals, keep)},
                                    {"left_out", PointsJson(image.left_out_pixels, image.left_out_residuals, keep)},
                                    {"picture", has_picture ? Json(ToBase64(image.small_jpeg)) : Json(nullptr)}});
  }
  return SharedData(ImagesName(report, c), data);
}

// Returns the charts of a camera, with a paragraph at the beginning of the first section; empty if it has no points.
std::string ResidualCharts(const ReportData& data, size_t c, std::string paragraph) {
  const CameraResiduals& camera = data.residuals[c];
  if (NumPoints(camera) == 0) return "";
  const std::string condition = Condition(data);
  const std::string sample = NumPoints(camera) > kMaxPoints ? " An evenly spaced sample of the points is shown." : "";
  struct Chart {
    const char* title;
    const char* view;
    std::string caption;
  };
  const Chart charts[] = {
      {"Residuals over the image", "residual-field",
       "Residuals (predicted minus observed) of the inliers" + condition + ". Click to open the capture." + sample},
      {"Image coverage", "coverage",
       "Percentage of the inliers. Cells without points do not constrain the lens model." + sample},
      {"Residuals by radius", "residual-radius", ""},
      {"Residual histogram", "histogram",
       "Residual coordinates of the inliers" + condition +
           ", and the normal distribution of the stated sigma. The outermost bars count all residuals beyond 5 sigma."},
      {"Residuals by capture", "capture-bars",
       "RMS of each image" + condition + ". The dashed line is the RMS of all points. Click to open the capture."}};
  std::string sections;
  for (const Chart& chart : charts) {
    const std::string figure = SharedViewFigure(chart.view, chart.caption, ImagesName(data, c));
    sections += PageSection(chart.title, std::exchange(paragraph, "") + figure);
  }
  return "<div class=\"columns\">\n" + sections + "</div>\n";
}

}  // namespace

std::string ImagesName(const ReportData& data, size_t camera) {
  return data.result.rig.cameras[camera].name.empty() ? "captures" : "captures_" + std::to_string(camera);
}

std::string PageSection(const std::string& heading, const std::string& content) {
  return content.empty() ? "" : "<section>" + Heading(heading) + content + "</section>\n";
}

std::string ResidualSections(const ReportData& data) {
  std::string sections;
  for (size_t c = 0; c < data.residuals.size(); ++c) {
    const std::string& name = data.result.rig.cameras[c].name;
    const std::string text = Paragraph(ResidualText(data, c));
    if (!name.empty()) sections += Heading("Camera " + name) + text;
    sections += ResidualData(data, c) + ResidualCharts(data, c, name.empty() ? text : "");
  }
  return sections;
}

}  // namespace heba
