// The summary that `heba detect` prints of the images: text for people, JSON for programs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace heba {

// The points of one target in one image.
struct TargetDetections {
  size_t num_points = 0;
  std::optional<double> rms_px;  // Residuals of the points; nothing if there are too few of them.
  std::string reason;            // Why points are missing; may be empty.
};

struct ImageDetections {
  std::string image;
  std::vector<TargetDetections> targets;  // One per target of the summary.

  bool IsSeen() const;  // Whether a target was detected.
};

struct CameraDetections {
  // The model that the residuals are relative to: a camera, given or estimated, or a homography.
  enum class Fit { kGivenCamera, kEstimatedCamera, kHomography };

  std::string camera;  // The name in a rig; empty for the only camera.
  Fit fit = Fit::kHomography;
  std::string camera_model;  // Empty with a homography.
  std::vector<ImageDetections> images;

  int NumSeen() const;  // Number of images in which a target was detected.
};

// A target that the images were searched for.
struct SearchedTarget {
  std::string name;  // The name in a rig; empty for the only target.
  size_t num_points = 0;
};

struct DetectionSummary {
  std::string name;
  std::vector<SearchedTarget> targets;
  std::vector<CameraDetections> cameras;
  std::filesystem::path folder;  // The folder of the results.

  int NumSeen() const;  // Number of images, of all cameras, in which a target was detected.
};

// Returns what was detected of one target in an image, in words.
std::string DetectionLine(const SearchedTarget& target, const TargetDetections& detections);
// Returns the images of each camera; one line per image and target.
std::string DetectionText(const DetectionSummary& summary);
// Returns one JSON document: {"schema": "heba/detection_summary/1", "heba", "name", "captures", "seen", "points",
// "target_points", "residuals": RESIDUALS, "folder", "cameras": [{"camera", "images", "seen", "residuals": RESIDUALS}],
// "images": [{"image", "camera", "target", "detected", "points", "target_points", "rms_px", "reason"}]}.
//
// `captures` is the number of images, `seen` that of the images in which a target was detected, `points` the total over
// all images. `images` has an entry for each target in each image. `camera` and `target` are names of a rig; they are
// null for the config of one camera, for which the outer `target_points` (the number of points of the target) and
// `residuals` are given, which are null for a rig. RESIDUALS: {"relative_to": "given_camera", "estimated_camera" or
// "homography", "camera_model"}.
std::string DetectionSummaryToJson(const DetectionSummary& summary);

}  // namespace heba
