#include "tools/run/captures.h"

#include <mutex>

#include "heba/base/error.h"
#include "heba/base/parallel.h"
#include "heba/config/yaml_reader.h"
#include "tools/files/digest.h"

namespace heba {
namespace {

std::string SizeText(int width_px, int height_px) {
  return std::to_string(width_px) + " x " + std::to_string(height_px);
}

// Throws InputError unless all detections have the same image size.
void CheckSizes(const RunConfig& config, const std::vector<CaptureDetection>& detections) {
  const int width_px = detections.front().width_px;
  const int height_px = detections.front().height_px;
  for (size_t i = 1; i < detections.size(); ++i) {
    if (detections[i].width_px != width_px || detections[i].height_px != height_px) {
      throw InputError(config.captures[i].name + ": is " + SizeText(detections[i].width_px, detections[i].height_px) +
                       " px, but " + config.captures[0].name + " is " + SizeText(width_px, height_px) +
                       " px; all images must come from one camera at one resolution");
    }
  }
}

// Returns the given detections with the size of their images or, if that is not stated, of the camera's.
std::vector<CaptureDetection> GivenDetections(const RunConfig& config) {
  std::vector<CaptureDetection> detections = config.given_detections;
  for (CaptureDetection& detection : detections) {
    if (detection.width_px > 0 && detection.height_px > 0) continue;
    if (!config.camera || config.camera->width_px == 0) {
      throw InputError(config.data_files.front().string() +
                       ": does not state the image size; provide a camera file that does (camera.intrinsics)");
    }
    detection.width_px = config.camera->width_px;
    detection.height_px = config.camera->height_px;
  }
  return detections;
}

}  // namespace

CaptureDetector::CaptureDetector(const std::string& target_used) {
  const auto create = [&](const TargetSettings& settings) {
    YAML::Node node = YAML::Load(target_used);
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

CaptureDetection CaptureDetector::Detect(const std::filesystem::path& image,
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

std::vector<CaptureDetection> DetectCaptures(const RunConfig& config, int num_threads, Verbosity verbosity) {
  if (!config.given_detections.empty()) {
    std::vector<CaptureDetection> given = GivenDetections(config);
    CheckSizes(config, given);
    return given;
  }
  // The expected size is read from the header before anything is decoded, because an image of another size may need
  // gigabytes.
  const std::optional<ImageSize> expected = ReadImageSize(config.captures.front().image);
  const double largest_cache_bytes = LargestCacheBytes();
  std::vector<CaptureDetection> detections(config.captures.size());
  {
    Progress progress("detect", static_cast<int>(detections.size()), verbosity);
    const CaptureDetector detector(config.target_used);
    std::mutex mutex;
    // Each image is read, searched and released; only a small copy is kept.
    ParallelFor(static_cast<int>(detections.size()), num_threads, [&](int index) {
      const size_t i = static_cast<size_t>(index);
      detections[i] = detector.Detect(config.captures[i].image, expected);
      const std::lock_guard<std::mutex> lock(mutex);
      progress.Step();
    });
    // The cache is only scanned if it has grown.
    if (detector.has_kept()) TrimCache(largest_cache_bytes);
  }
  CheckSizes(config, detections);
  return detections;
}

void CheckCameraByHeader(const RunConfig& config) {
  const std::filesystem::path& image = config.captures.front().image;
  if (!config.camera || image.empty()) return;
  const std::optional<ImageSize> size = ReadImageSize(image);
  if (!size) return;
  RunConfig copy = config;
  CaptureDetection first;
  first.width_px = size->width_px;
  first.height_px = size->height_px;
  FitCameraToImages(first, &copy);
}

void FitCameraToImages(const CaptureDetection& first, RunConfig* config) {
  if (!config->camera) return;
  Camera& camera = *config->camera;
  if (camera.width_px == 0) {
    camera.width_px = first.width_px;
    camera.height_px = first.height_px;
  }
  if (camera.width_px != first.width_px || camera.height_px != first.height_px) {
    throw InputError(config->camera_file + ": is for images of " + SizeText(camera.width_px, camera.height_px) +
                     " px, but " + config->captures[0].name + " is " + SizeText(first.width_px, first.height_px) +
                     " px; provide the intrinsics of that resolution");
  }
}

View ViewOf(const RunConfig& config, size_t capture, Observations observations) {
  const Capture& from = config.captures[capture];
  return {from.name, CameraMountFromTargetMount(config.setup, from.base_from_gripper), std::move(observations),
          from.role};
}

std::vector<View> ViewsOf(const RunConfig& config, const std::vector<CaptureDetection>& detections) {
  std::vector<View> views;
  for (size_t i = 0; i < config.captures.size(); ++i) {
    if (detections[i].detection.ids.empty()) continue;
    views.push_back(ViewOf(config, i, ObservationsOf(*config.target, detections[i].detection)));
  }
  return views;
}

CalibrationOptions OptionsOf(const RunConfig& config, int width_px, int height_px) {
  CalibrationOptions options;
  options.methods = config.methods;
  options.seed = config.seed;
  options.bundle = config.bundle;
  options.choose = config.choose;
  options.choose_camera_model = config.choose_camera_model;
  options.setup = config.setup;
  options.camera = config.camera;
  options.camera_model = config.camera_model;
  options.width_px = width_px;
  options.height_px = height_px;
  options.symmetries = config.target->Symmetries();
  options.shape = DesignedShape(AllPoints(*config.target).points_in_target);
  return options;
}

}  // namespace heba
