#include "tools/pages/camera_page.h"

#include <algorithm>
#include <cmath>

#include "heba/base/text.h"
#include "heba/camera/camera_model.h"
#include "tools/pages/page.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

std::vector<PageCell> Cells(const std::vector<std::string>& texts, size_t num_words = 1) {
  std::vector<PageCell> cells;
  for (size_t i = 0; i < texts.size(); ++i) cells.push_back({texts[i], i >= num_words});
  return cells;
}

std::string IntrinsicsTable(const CameraCalibration& calibration) {
  std::vector<std::vector<PageCell>> rows;
  const std::vector<std::string>& names = calibration.camera.Model().param_names();
  for (size_t i = 0; i < names.size(); ++i) {
    const auto place = static_cast<Eigen::Index>(i);
    rows.push_back(Cells({names[i], Significant(calibration.camera.params[i], 7),
                          Significant(std::sqrt(calibration.covariance(place, place)), 2)}));
  }
  return HtmlTable({"parameter", "value", "one sigma"}, rows);
}

std::string LensTable(const CameraCalibration& calibration) {
  std::vector<std::vector<PageCell>> rows;
  std::string reasons;
  for (size_t i = 0; i < calibration.lenses.size(); ++i) {
    const LensFit& lens = calibration.lenses[i];
    if (!lens.camera) {
      reasons += Paragraph("Not " + lens.model + ": " + FailureText(lens.reason) + ".");
      continue;
    }
    const bool is_chosen = i == calibration.chosen;
    rows.push_back(
        Cells({lens.model + (is_chosen ? " (chosen)" : ""), Significant(lens.rms_px, 3),
               lens.holdout_rms_px ? Significant(*lens.holdout_rms_px, 3) : "-", Fixed(lens.log_likelihood, 1)}));
    rows.back().front().is_strong = is_chosen;
  }
  return HtmlTable({"model", "RMS, px", "hold-out RMS, px", "log-likelihood"}, rows) + reasons;
}

// Returns the map as an SVG: each region of the image with its sigma; those without points are hatched by a dashed
// frame.
std::string MapFigure(const CameraCalibration& calibration, const CameraMap& map) {
  constexpr double kWidth = 720;
  const double height = kWidth * calibration.camera.height_px / calibration.camera.width_px;
  const double cell_width = kWidth / map.columns;
  const double cell_height = height / map.rows;
  double largest = 0;
  for (const double sigma_px : map.sigmas_px) {
    if (std::isfinite(sigma_px)) largest = std::max(largest, sigma_px);
  }
  std::string svg = "<svg viewBox=\"0 0 " + Fixed(kWidth, 0) + " " + Fixed(height, 0) +
                    "\" role=\"img\" aria-label=\"projection uncertainty over the image\" style=\"max-width:720px;"
                    "width:100%;height:auto\">";
  for (size_t i = 0; i < map.sigmas_px.size(); ++i) {
    const auto columns = static_cast<size_t>(map.columns);
    const size_t place_in_column = i / columns;
    const auto column = static_cast<double>(i % columns);
    const auto row = static_cast<double>(place_in_column);
    const double sigma_px = map.sigmas_px[i];
    const bool is_known = std::isfinite(sigma_px);
    const double share = is_known && largest > 0 ? sigma_px / largest : 1;
    svg += "<rect x=\"" + Fixed(column * cell_width, 1) + "\" y=\"" + Fixed(row * cell_height, 1) + "\" width=\"" +
           Fixed(cell_width - 1, 1) + "\" height=\"" + Fixed(cell_height - 1, 1) + "\" fill=\"rgb(13,148,136)\" " +
           "fill-opacity=\"" + Fixed(0.12 + 0.6 * share, 2) + "\"" +
           (map.num_points[i] == 0 ? " stroke=\"currentColor\" stroke-dasharray=\"4 3\"" : "") + "/>";
    svg += "<text x=\"" + Fixed((column + 0.5) * cell_width, 1) + "\" y=\"" + Fixed((row + 0.5) * cell_height + 4, 1) +
           "\" text-anchor=\"middle\" font-size=\"12\" fill=\"currentColor\">" +
           (is_known ? Significant(sigma_px, 2) : "-") + "</text>";
  }
  return svg + "</svg>";
}

std::string ImageTable(const CameraCalibration& calibration, const std::vector<UnusedImage>& unused) {
  std::vector<std::vector<PageCell>> rows;
  for (const CameraViewOutcome& view : calibration.views) {
    rows.push_back(Cells({view.name, view.used ? Significant(view.rms_px, 3) : "-", std::to_string(view.num_rejected),
                          view.used ? "" : "not used"}));
  }
  for (const UnusedImage& image : unused) rows.push_back(Cells({image.image, "-", "-", image.reason}));
  return HtmlTable({"image", "RMS, px", "rejected points", ""}, rows);
}

}  // namespace

std::string CameraPage(const std::string& name, const CameraCalibration& calibration, const CameraMap& map,
                       const std::vector<UnusedImage>& unused) {
  const LensFit& chosen = calibration.lenses[calibration.chosen];
  std::string body = "<h1>" + EscapedForMarkup(name) + "</h1>\n";
  body += Paragraph("The lens is " + chosen.model + ": " + Significant(chosen.rms_px, 3) + " px RMS" +
                    (chosen.holdout_rms_px
                         ? ", " + Significant(*chosen.holdout_rms_px, 3) +
                               " px in images that were held out (about the best pose of the target in each)"
                         : "") +
                    ". " + Capitalised(ProjectionText(map)) + ".");
  body += Heading("Intrinsics") + IntrinsicsTable(calibration);
  body += Heading("Projection uncertainty") +
          Paragraph(
              "One sigma of the pixel at which a far point is seen, px, after the rotation of the camera that "
              "compensates most of it. No point was seen in regions with a dashed frame.") +
          MapFigure(calibration, map);
  body += Heading("Models") + LensTable(calibration);
  body += Heading("Images") + ImageTable(calibration, unused);
  return HtmlPage(name, body);
}

}  // namespace heba
