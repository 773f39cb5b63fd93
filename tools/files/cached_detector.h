// Detects the target in images, and keeps the detections in the cache.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/run_types.h"
#include "tools/files/detection_cache.h"

namespace heba {

// Searches images for a target. Detections are cached (DetectionCache) independently of the target's dimensions, so an
// image is searched once even if the dimensions in the config change.
class CachedDetector {
 public:
  // `target_used`: the target as used, as YAML. Throws InputError if the size of the cache is wrong
  // (LargestCacheBytes).
  explicit CachedDetector(const std::string& target_used);
  // Trims the cache if it has grown.
  ~CachedDetector();
  CachedDetector(const CachedDetector&) = delete;
  CachedDetector& operator=(const CachedDetector&) = delete;

  // Returns the detection in an image, as DetectWithDigest. Thread-safe.
  CaptureDetection Detect(const std::filesystem::path& image, const std::optional<ImageSize>& expected) const;
  // Returns whether this detector has added a detection to the cache.
  bool has_kept() const { return has_kept_; }

 private:
  std::unique_ptr<const Target> target_;
  std::optional<DetectionCache> cache_;
  double largest_cache_bytes_;
  mutable std::atomic<bool> has_kept_ = false;
};

// Returns a function that detects a target by a CachedDetector.
DetectFunction CachedDetection(const std::string& target_used);
// Returns such functions for RunOptions::detect, one for each target of a data set; none if it has no images to search.
std::vector<DetectFunction> CachedDetections(const Dataset& dataset, const std::vector<std::string>& targets_used);

}  // namespace heba
