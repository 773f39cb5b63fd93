#include "tools/text/camera_text.h"

#include <algorithm>
#include <cmath>

#include "heba/base/median.h"
#include "heba/base/text.h"
#include "heba/camera/camera_model.h"
#include "tools/text/failure_text.h"

namespace heba {
namespace {

std::string PxText(const std::optional<double>& px) { return px ? Significant(*px, 3) : "-"; }

}  // namespace

std::string IntrinsicsLines(const CameraCalibration& calibration) {
  std::string lines;
  const std::vector<std::string>& names = calibration.camera.Model().param_names();
  for (size_t i = 0; i < names.size(); ++i) {
    const auto place = static_cast<Eigen::Index>(i);
    const double sigma = std::sqrt(calibration.covariance(place, place));
    lines +=
        "  " + names[i] + " " + Significant(calibration.camera.params[i], 6) + " +- " + Significant(sigma, 2) + "\n";
  }
  return lines;
}

std::string ProjectionText(const CameraMap& map) {
  std::vector<double> known;
  for (const double sigma_px : map.sigmas_px) {
    if (std::isfinite(sigma_px)) known.push_back(sigma_px);
  }
  const auto num_empty = std::count(map.num_points.begin(), map.num_points.end(), 0);
  std::string text;
  if (!known.empty()) {
    text = "the projection is known to " + Significant(Median(known), 2) +
           " px (one sigma, median over the image) and " +
           Significant(*std::max_element(known.begin(), known.end()), 2) + " px at its worst place";
  }
  if (num_empty > 0) {
    text += std::string(text.empty() ? "" : "; ") + "no point was seen in " + std::to_string(num_empty) + " of " +
            std::to_string(map.num_points.size()) + " regions of the image, where the lens is extrapolated";
  }
  return text;
}

std::string CameraTable(const CameraCalibration& calibration, const CameraMap& map) {
  std::string table =
      PadRight("model", 17) + PadLeft("rms px", 9) + PadLeft("hold-out px", 13) + PadLeft("log-likelihood", 16) + "\n";
  for (size_t i = 0; i < calibration.lenses.size(); ++i) {
    const LensFit& lens = calibration.lenses[i];
    table += PadRight(lens.model, 17);
    if (!lens.camera) {
      table += "  " + FailureText(lens.reason) + "\n";
      continue;
    }
    table += PadLeft(PxText(lens.rms_px), 9) + PadLeft(PxText(lens.holdout_rms_px), 13) +
             PadLeft(Fixed(lens.log_likelihood, 1), 16) + (i == calibration.chosen ? "  chosen" : "") + "\n";
  }
  const auto num_used = std::count_if(calibration.views.begin(), calibration.views.end(),
                                      [](const CameraViewOutcome& view) { return view.used; });
  table += "\n" + calibration.camera.model + ", " + std::to_string(num_used) + " of " +
           std::to_string(calibration.views.size()) + " images that show the target were used, pixel noise " +
           Significant(calibration.pixel_sigma_px, 3) + " px per coordinate\n" + IntrinsicsLines(calibration);
  if (calibration.lenses[calibration.chosen].is_bent) {
    table += "target: bent by " + ShownAmount(1000 * calibration.shape.params[2], 2) + " mm along x and " +
             ShownAmount(1000 * calibration.shape.params[3], 2) + " mm along y in its middle, twisted by " +
             ShownAmount(1000 * calibration.shape.params[4], 2) + " mm at its corners\n";
  }
  return table + ProjectionText(map) + "\n";
}

}  // namespace heba
