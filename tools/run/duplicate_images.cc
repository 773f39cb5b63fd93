#include "tools/run/duplicate_images.h"

#include <algorithm>
#include <map>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/base/units.h"

namespace heba {
namespace {

constexpr double kSamePoseM = 1e-4;
constexpr double kSamePoseRad = DegToRad(0.01);

bool HaveSamePose(const PosedImage& a, const PosedImage& b) {
  return std::equal(a.base_from_gripper.begin(), a.base_from_gripper.end(), b.base_from_gripper.begin(),
                    [](const Rigid3d& pose, const Rigid3d& other) {
                      return DistanceM(pose, other) <= kSamePoseM && AngleRad(pose, other) <= kSamePoseRad;
                    });
}

}  // namespace

ImagesOfCamera PosedImagesOf(const Dataset& dataset, const std::vector<TargetDetection>& detections, size_t camera) {
  std::map<size_t, PosedImage> image_of;  // By the capture.
  for (const TargetDetection& detection : detections) {
    if (detection.camera != camera) continue;
    const Recording& capture = dataset.captures[detection.capture];
    const auto [entry, is_new] = image_of.try_emplace(detection.capture);
    PosedImage& image = entry->second;
    if (is_new) image = {capture.name, capture.base_from_gripper, detection.detection.image_digest, false};
    image.shows_target |= !detection.detection.detection.ids.empty();
  }
  ImagesOfCamera all;
  for (auto& [capture, image] : image_of) {
    all.captures.push_back(capture);
    all.images.push_back(std::move(image));
  }
  return all;
}

std::vector<SharedImage> FindSharedImages(const std::vector<PosedImage>& images) {
  std::map<std::string, std::vector<size_t>> images_of;
  for (size_t i = 0; i < images.size(); ++i) {
    if (!images[i].digest.empty()) images_of[images[i].digest].push_back(i);
  }
  std::vector<SharedImage> all;
  for (const auto& entry : images_of) {
    const std::vector<size_t>& sharing = entry.second;
    if (sharing.size() < 2) continue;
    const bool has_one_pose = std::all_of(sharing.begin(), sharing.end(),
                                          [&](size_t i) { return HaveSamePose(images[sharing.front()], images[i]); });
    all.push_back({sharing, has_one_pose});
  }
  std::sort(all.begin(), all.end(),
            [](const SharedImage& a, const SharedImage& b) { return a.images.front() < b.images.front(); });
  return all;
}

size_t FindOtherPose(const std::vector<PosedImage>& images, const SharedImage& shared, size_t image) {
  const auto other = std::find_if(shared.images.begin(), shared.images.end(),
                                  [&](size_t i) { return !HaveSamePose(images[i], images[image]); });
  return other == shared.images.end() ? shared.images.front() : *other;
}

std::vector<DuplicateImage> FindDuplicates(const std::vector<PosedImage>& images) {
  std::vector<DuplicateImage> duplicates;
  for (const SharedImage& shared : FindSharedImages(images)) {
    const size_t first = shared.images.front();
    if (!images[first].shows_target) continue;
    for (const size_t i : shared.images) {
      if (!shared.has_one_pose) {
        duplicates.push_back({i, "",
                              "the same image as " + images[FindOtherPose(images, shared, i)].name +
                                  ", byte by byte, but with another pose of the robot: at most one of the poses "
                                  "belongs to the image, so no capture with this image is used"});
      } else if (i != first) {
        duplicates.push_back({i, images[first].name, "the same image as " + images[first].name + ", byte by byte"});
      }
    }
  }
  std::sort(duplicates.begin(), duplicates.end(),
            [](const DuplicateImage& a, const DuplicateImage& b) { return a.image < b.image; });
  return duplicates;
}

std::vector<DuplicateInDataset> FindDuplicates(const Dataset& dataset, const std::vector<TargetDetection>& detections) {
  std::vector<DuplicateInDataset> duplicates;
  for (size_t c = 0; c < dataset.rig.cameras.size(); ++c) {
    const ImagesOfCamera searched = PosedImagesOf(dataset, detections, c);
    for (DuplicateImage& duplicate : FindDuplicates(searched.images)) {
      duplicates.push_back(
          {searched.captures[duplicate.image], c, std::move(duplicate.repeat_of), std::move(duplicate.reason)});
    }
  }
  return duplicates;
}

bool IsDuplicate(const std::vector<DuplicateInDataset>& duplicates, const TargetDetection& detection) {
  return std::any_of(duplicates.begin(), duplicates.end(), [&](const DuplicateInDataset& duplicate) {
    return duplicate.capture == detection.capture && duplicate.camera == detection.camera;
  });
}

std::vector<std::string> DuplicateNotes(const std::vector<DuplicateInDataset>& duplicates, size_t num_captures) {
  const auto num_repeats = std::count_if(duplicates.begin(), duplicates.end(), [](const DuplicateInDataset& duplicate) {
    return !duplicate.repeat_of.empty();
  });
  const auto num_contradictory = static_cast<std::ptrdiff_t>(duplicates.size()) - num_repeats;
  const std::string of_captures = " of " + std::to_string(num_captures) + " captures ";
  std::vector<std::string> notes;
  if (num_repeats > 0) {
    notes.push_back(std::to_string(num_repeats) + of_captures +
                    "repeat the image of another one, byte by byte, and its pose; they do not count");
  }
  if (num_contradictory > 0) {
    notes.push_back(std::to_string(num_contradictory) + of_captures +
                    "share their images, byte by byte, with captures that have another pose; none of them is used");
  }
  return notes;
}

std::vector<ImageResult> WithDuplicates(std::vector<ImageResult> images, const Dataset& dataset,
                                        const std::vector<DuplicateInDataset>& duplicates,
                                        const std::vector<TargetDetection>& detections) {
  for (const DuplicateInDataset& duplicate : duplicates) {
    const auto entry = std::find_if(images.begin(), images.end(), [&](const ImageResult& image) {
      return image.capture == dataset.captures[duplicate.capture].name &&
             image.camera == dataset.rig.cameras[duplicate.camera].name;
    });
    CHECK(entry != images.end());
    entry->reason = duplicate.reason;
    entry->repeat_of = duplicate.repeat_of;
    entry->targets.clear();
    for (const TargetDetection& detection : detections) {
      if (detection.capture != duplicate.capture || detection.camera != duplicate.camera) continue;
      const auto num_points = static_cast<int>(detection.detection.detection.ids.size());
      if (num_points == 0) continue;
      entry->targets.push_back(
          {dataset.rig.targets[detection.target].name, num_points, 0, {}, false, duplicate.reason});
    }
  }
  return images;
}

}  // namespace heba
