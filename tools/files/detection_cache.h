// Caches detections by the contents of image and target and by the program that made them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "heba/detection.h"

namespace heba {

// Returns the folder of the cache; empty if nothing is to be kept.
std::filesystem::path CacheFolder();

struct CacheSize {
  size_t num_entries = 0;
  double bytes = 0;
};
CacheSize SizeOfCache();
// Returns the largest size of the cache: HEBA_CACHE_MB in the environment, or 1024 MB. Throws InputError if
// HEBA_CACHE_MB is no size.
double LargestCacheBytes();
// Removes the least recently used entries until at most `most_bytes` are left, and no other files. Returns the number
// and size of the removed entries.
CacheSize TrimCache(double most_bytes);

class DetectionCache {
 public:
  // Uses the folder that HEBA_CACHE names (empty: nothing is cached), otherwise the user's cache folder (`heba` in
  // XDG_CACHE_HOME, or in .cache at home). `target` is the target that is detected, as used.
  explicit DetectionCache(const std::string& target);

  // Returns the detection in the image file with this digest; nothing if it is not cached.
  std::optional<CaptureDetection> Find(const std::string& image_digest) const;
  // Keeps a detection. A cache that cannot be written is not an error.
  void Keep(const std::string& image_digest, const CaptureDetection& detection) const;

 private:
  std::filesystem::path FileOf(const std::string& image_digest) const;

  std::filesystem::path folder_;  // Empty: nothing is cached.
  std::string context_;
};

}  // namespace heba
