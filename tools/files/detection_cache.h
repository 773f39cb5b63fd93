// What was found in pictures before, by the content of picture and target and by the program that found it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "targets/detection.h"

namespace heba {

// The folder of what is kept; empty if nothing is to be.
std::filesystem::path CacheFolder();

struct CacheSize {
  size_t num_entries = 0;
  double bytes = 0;
};
CacheSize SizeOfCache();
// The most that is kept: HEBA_CACHE_MB in the environment, or 1024 MB.
double LargestCacheBytes();
// Removes the entries that were used longest ago until `most_bytes` are left; nothing but entries. What was removed.
CacheSize TrimCache(double most_bytes);

class DetectionCache {
 public:
  // In the folder that HEBA_CACHE names (empty: none is kept), else in the user's cache folder (XDG_CACHE_HOME, or
  // .cache at home). `target` is the target that is searched for, as used.
  explicit DetectionCache(const std::string& target);

  // The detection of the picture's file; nothing if it is not known.
  std::optional<CaptureDetection> Find(const std::string& image_digest) const;
  // Keeps one. A cache that cannot be written is none: no error.
  void Keep(const std::string& image_digest, const CaptureDetection& detection) const;

 private:
  std::filesystem::path FileOf(const std::string& image_digest) const;

  std::filesystem::path folder_;  // Empty: none.
  std::string context_;
};

}  // namespace heba
