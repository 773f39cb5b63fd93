// From a run's config to what is calibrated: its pictures' detections, the views that they make, the options.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "solvers/calibration/calibration.h"
#include "targets/detection.h"
#include "targets/target.h"
#include "tools/config/run_config.h"
#include "tools/files/detection_cache.h"
#include "tools/text/console.h"

namespace heba {

// Searches images for a target, each one once, however large the target is said to be: what was found is kept
// (DetectionCache).
class CaptureDetector {
 public:
  // The target as used, as YAML.
  explicit CaptureDetector(const std::string& target_used);

  // InputError if the image cannot be read or is of another size than `expected`.
  CaptureDetection Detect(const std::filesystem::path& image, const std::optional<ImageSize>& expected) const;
  // Whether the cache has grown by a detection of this detector.
  bool has_kept() const { return has_kept_; }

 private:
  std::unique_ptr<const Target> target_;
  std::optional<DetectionCache> cache_;
  mutable std::atomic<bool> has_kept_ = false;
};

// Detects the target in all captures, with the digests of their images and progress on the terminal. InputError if
// images cannot be read or differ in size.
std::vector<CaptureDetection> DetectCaptures(const RunConfig& config, int num_threads, Verbosity verbosity);

// Throws the InputError of FitCameraToImages by the header of the first picture, before any is decoded.
void CheckCameraByHeader(const RunConfig& config);

// Gives the config's camera, if there is one, the size of the pictures where its file does not tell it. InputError if
// the two disagree.
void FitCameraToImages(const CaptureDetection& first, RunConfig* config);

// One capture, numbered as in RunConfig::captures, with what its picture shows.
View ViewOf(const RunConfig& config, size_t capture, Observations observations);

// Of the captures in which the target was seen.
std::vector<View> ViewsOf(const RunConfig& config, const std::vector<CaptureDetection>& detections);

CalibrationOptions OptionsOf(const RunConfig& config, int width_px, int height_px);

}  // namespace heba
