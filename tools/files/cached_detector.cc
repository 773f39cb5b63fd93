#include "tools/files/cached_detector.h"

#include "heba/base/error.h"
#include "heba/config/yaml_reader.h"
#include "heba/image_detection.h"
#include "tools/run/digest.h"

namespace heba {

CachedDetector::CachedDetector(const std::string& target_used) : largest_cache_bytes_(LargestCacheBytes()) {
  const auto create = [&](const TargetSettings& settings) {
    YAML::Node node = YAML::Load(target_used);
    node.remove("scale_sigma");  // No detection depends on it.
    for (const auto& [key, value] : settings) node[key] = value;
    MapReader reader(ConfigValue(node, "target", "target"));
    target_ = CreateTarget(reader);
    cache_.emplace(YAML::Dump(reader.used()));
  };
  create({});
  try {
    create(target_->UnitLengths());
  } catch (const InputError&) {
    // Rounding makes a target at the limit of the possible dimensions invalid; it is searched for in its own
    // dimensions.
  }
}

CachedDetector::~CachedDetector() {
  // The cache is only scanned if it has grown.
  if (has_kept_) TrimCache(largest_cache_bytes_);
}

CaptureDetection CachedDetector::Detect(const std::filesystem::path& image,
                                        const std::optional<ImageSize>& expected) const {
  const std::string digest = DigestOfFile(image);
  std::optional<CaptureDetection> detection = cache_->Find(digest);
  if (!detection) {
    detection = DetectCapture(*target_, image, expected);
    // It is not cached if the file was replaced meanwhile.
    if (DigestOfFile(image) == digest) {
      cache_->Keep(digest, *detection);
      has_kept_ = true;
    }
  }
  detection->image_digest = digest;
  return std::move(*detection);
}

DetectFunction CachedDetection(const std::string& target_used) {
  const auto detector = std::make_shared<const CachedDetector>(target_used);
  return [detector](const std::filesystem::path& image, const std::optional<ImageSize>& expected) {
    return detector->Detect(image, expected);
  };
}

std::vector<DetectFunction> CachedDetections(const Dataset& dataset, const std::vector<std::string>& targets_used) {
  std::vector<DetectFunction> detect;
  if (!dataset.given_detections.empty() || !dataset.target_poses.empty()) return detect;
  for (const std::string& target : targets_used) detect.push_back(CachedDetection(target));
  return detect;
}

}  // namespace heba
