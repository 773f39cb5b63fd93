// Prepares a run's captures for calibration: detections in its images, the views made from them, the options.
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

// Searches images for a target. Detections are cached (DetectionCache) independently of the target's dimensions, so an
// image is searched once even if the dimensions in the config change.
class CaptureDetector {
 public:
  // `target_used`: the target as used, as YAML.
  explicit CaptureDetector(const std::string& target_used);

  // Returns the detection in an image. Throws InputError if the image cannot be read or is of another size than
  // `expected`.
  CaptureDetection Detect(const std::filesystem::path& image, const std::optional<ImageSize>& expected) const;
  // Returns whether this detector has added a detection to the cache.
  bool has_kept() const { return has_kept_; }

 private:
  std::unique_ptr<const Target> target_;
  std::optional<DetectionCache> cache_;
  mutable std::atomic<bool> has_kept_ = false;
};

// Detects the target in all captures, with the digests of their images and progress on the terminal. Throws InputError
// if images cannot be read or differ in size.
std::vector<CaptureDetection> DetectCaptures(const RunConfig& config, int num_threads, Verbosity verbosity);

// Throws the InputError of FitCameraToImages by the header of the first image, before any is decoded.
void CheckCameraByHeader(const RunConfig& config);

// Sets the size of the config's camera, if there is one, to that of the images if its file does not state it. Throws
// InputError if the sizes differ.
void FitCameraToImages(const CaptureDetection& first, RunConfig* config);

// Returns the view of one capture, an index into RunConfig::captures, with the observations in its image.
View ViewOf(const RunConfig& config, size_t capture, Observations observations);

// Returns the views of the captures in which the target was seen.
std::vector<View> ViewsOf(const RunConfig& config, const std::vector<CaptureDetection>& detections);

CalibrationOptions OptionsOf(const RunConfig& config, int width_px, int height_px);

}  // namespace heba
