#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "heba/image_detection.h"
#include "targets/images/image.h"
#include "tools/run/digest.h"
#include "tools/run/run_stage.h"

namespace heba {
namespace {

// Returns how messages call an image. A camera without a name has one image for each capture.
std::string ImageName(const Dataset& dataset, const TargetDetection& detection) {
  const std::string& camera = dataset.rig.cameras[detection.camera].name;
  const Recording& capture = dataset.captures[detection.capture];
  return camera.empty() ? capture.name : camera + "/" + capture.images[detection.camera].filename().string();
}

ImageSize SizeOf(const CaptureDetection& detection) { return {detection.width_px, detection.height_px}; }
bool IsKnown(const ImageSize& size) { return size.width_px > 0 && size.height_px > 0; }
std::string Text(const ImageSize& size) { return ImageSizeText(size.width_px, size.height_px); }

// Throws InputError unless a camera, if it is given, is for images of this size.
void CheckSizeOfCamera(const Dataset& dataset, const TargetDetection& image, const ImageSize& size) {
  const Camera& camera = dataset.rig.cameras[image.camera].camera;
  const ImageSize stated{camera.width_px, camera.height_px};
  if (!dataset.has_camera[image.camera] || !IsKnown(stated) || stated == size) return;
  throw InputError(dataset.camera_sources[image.camera] + ": is for images of " + Text(stated) + ", but " +
                   ImageName(dataset, image) + " is " + Text(size) + "; provide the intrinsics of that resolution");
}

// Returns the first detection of each camera.
std::map<size_t, const TargetDetection*> FirstOfCameras(const std::vector<TargetDetection>& detections) {
  std::map<size_t, const TargetDetection*> first_of;
  for (const TargetDetection& detection : detections) first_of.emplace(detection.camera, &detection);
  return first_of;
}

// Throws InputError unless all images of a camera have the same size.
void CheckSizes(const Dataset& dataset, const std::vector<TargetDetection>& detections) {
  const std::map<size_t, const TargetDetection*> first_of = FirstOfCameras(detections);
  for (const TargetDetection& detection : detections) {
    const TargetDetection& first = *first_of.at(detection.camera);
    if (SizeOf(detection.detection) == SizeOf(first.detection)) continue;
    throw InputError(ImageName(dataset, detection) + ": is " + Text(SizeOf(detection.detection)) + ", but " +
                     ImageName(dataset, first) + " is " + Text(SizeOf(first.detection)) +
                     "; all images must come from one camera at one resolution");
  }
}

// Throws InputError if two cameras have the same images: images of two cameras are never equal to the last bit.
void CheckOwnImages(const Dataset& dataset, const std::vector<TargetDetection>& detections) {
  std::map<std::pair<size_t, std::string>, std::set<size_t>> cameras_of;  // By capture and digest.
  std::map<size_t, std::set<size_t>> captures_of;                         // By camera.
  for (const TargetDetection& detection : detections) {
    captures_of[detection.camera].insert(detection.capture);
    const std::string& digest = detection.detection.image_digest;
    if (!digest.empty()) cameras_of[{detection.capture, digest}].insert(detection.camera);
  }
  std::map<std::pair<size_t, size_t>, size_t> num_shared;
  for (const auto& [image, cameras] : cameras_of) {
    for (auto a = cameras.begin(); a != cameras.end(); ++a) {
      for (auto b = std::next(a); b != cameras.end(); ++b) ++num_shared[{*a, *b}];
    }
  }
  for (const auto& [pair, count] : num_shared) {
    const auto [a, b] = pair;
    // A few may be frames without content.
    if (2 * count <= std::min(captures_of[a].size(), captures_of[b].size())) continue;
    throw InputError("cameras " + dataset.rig.cameras[a].name + " and " + dataset.rig.cameras[b].name +
                     " have the same images in " + std::to_string(count) + " captures; correct the images of one");
  }
}

// Returns the given detections with the size of their images or, if that is not stated, of the camera's.
std::vector<TargetDetection> DetectionsAsGiven(const Dataset& dataset) {
  std::vector<TargetDetection> detections = dataset.given_detections;
  for (TargetDetection& given : detections) {
    if (IsKnown(SizeOf(given.detection))) continue;
    const Camera& camera = dataset.rig.cameras[given.camera].camera;
    if (!dataset.has_camera[given.camera] || camera.width_px == 0) {
      throw InputError(dataset.detections_source + ": does not state the image size; provide a camera that does");
    }
    given.detection.width_px = camera.width_px;
    given.detection.height_px = camera.height_px;
  }
  return detections;
}

// Detects every target in every image. The size of the images is read from the header of each camera's first one before
// any is decoded, because one of another size may need gigabytes.
std::vector<TargetDetection> SearchImages(const Dataset& dataset, const std::vector<DetectFunction>& detect,
                                          int num_threads, RunObserver* observer) {
  std::vector<TargetDetection> detections;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    for (size_t c = 0; c < dataset.rig.cameras.size(); ++c) {
      if (dataset.captures[i].images[c].empty()) continue;
      for (size_t t = 0; t < dataset.targets.size(); ++t) detections.push_back({i, c, t, {}});
    }
  }
  std::vector<std::optional<ImageSize>> expected(dataset.rig.cameras.size());
  for (const auto& [camera, first] : FirstOfCameras(detections)) {
    expected[camera] = ReadImageSize(dataset.captures[first->capture].images[camera]);
  }
  StageReport report(RunStage::kDetection, static_cast<int>(detections.size()), observer);
  std::mutex mutex;
  // Each image is read, searched and released; only a small copy is kept.
  ParallelFor(static_cast<int>(detections.size()), num_threads, [&](int index) {
    TargetDetection& detection = detections[static_cast<size_t>(index)];
    const std::filesystem::path& image = dataset.captures[detection.capture].images[detection.camera];
    const size_t t = detection.target;
    detection.detection = detect.empty() || !detect[t]
                              ? DetectWithDigest(*dataset.targets[t], image, expected[detection.camera])
                              : detect[t](image, expected[detection.camera]);
    const std::lock_guard<std::mutex> lock(mutex);
    report.Step();
  });
  return detections;
}

}  // namespace

CaptureDetection DetectWithDigest(const Target& target, const std::filesystem::path& image,
                                  const std::optional<ImageSize>& expected) {
  const std::string digest = DigestOfFile(image);
  CaptureDetection detection = DetectCapture(target, image, expected);
  detection.image_digest = digest;
  return detection;
}

std::vector<TargetDetection> DetectDataset(const Dataset& dataset, const std::vector<DetectFunction>& detect,
                                           int num_threads, RunObserver* observer) {
  std::vector<TargetDetection> detections = dataset.given_detections.empty()
                                                ? SearchImages(dataset, detect, num_threads, observer)
                                                : DetectionsAsGiven(dataset);
  CheckSizes(dataset, detections);
  CheckOwnImages(dataset, detections);
  return detections;
}

void CheckCamerasByHeader(const Dataset& dataset) {
  if (!dataset.given_detections.empty()) return;
  for (size_t c = 0; c < dataset.rig.cameras.size(); ++c) {
    const auto first = std::find_if(dataset.captures.begin(), dataset.captures.end(),
                                    [&](const Recording& capture) { return !capture.images[c].empty(); });
    if (!dataset.has_camera[c] || first == dataset.captures.end()) continue;
    const std::optional<ImageSize> size = ReadImageSize(first->images[c]);
    const auto index = static_cast<size_t>(first - dataset.captures.begin());
    if (size) CheckSizeOfCamera(dataset, {index, c, 0, {}}, *size);
  }
}

Problem WithImageSizes(const Dataset& dataset, const std::vector<TargetDetection>& detections) {
  Problem rig = dataset.rig;
  for (const auto& [camera, first] : FirstOfCameras(detections)) {
    CheckSizeOfCamera(dataset, *first, SizeOf(first->detection));
    rig.cameras[camera].camera.width_px = first->detection.width_px;
    rig.cameras[camera].camera.height_px = first->detection.height_px;
  }
  return rig;
}

}  // namespace heba
