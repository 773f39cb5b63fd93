// The summary that `heba detect` prints of the images: text for people, JSON for programs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace heba {

struct ImageDetections {
  std::string image;
  size_t num_points = 0;
  std::optional<double> rms_px;  // Residuals of the points; nothing if there are too few of them.
  std::string reason;            // Why points are missing; may be empty.
};

struct DetectionSummary {
  // The model that the residuals are relative to: a camera, given or estimated, or a homography.
  enum class Fit { kGivenCamera, kEstimatedCamera, kHomography };

  std::string name;
  size_t num_target_points = 0;
  Fit fit = Fit::kHomography;
  std::string camera_model;  // Empty with a homography.
  std::vector<ImageDetections> images;
  std::filesystem::path folder;  // The folder of the results.

  int NumSeen() const;  // Number of images in which the target was detected.
};

// Returns one line on an image, without a line end.
std::string DetectionLine(const DetectionSummary& summary, const ImageDetections& image);
std::string DetectionText(const DetectionSummary& summary);
// Returns one JSON document: {"schema": "heba/detection_summary/1", "heba", "name", "captures", "seen", "points",
// "target_points", "residuals": {"relative_to": "given_camera", "estimated_camera" or "homography", "camera_model"},
// "folder", "images": [{"image", "detected", "points", "rms_px", "reason"}]}. `points` is the total over all images,
// `target_points` the number of points of the target.
std::string DetectionSummaryToJson(const DetectionSummary& summary);

}  // namespace heba
