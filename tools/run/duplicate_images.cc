#include "tools/run/duplicate_images.h"

#include <algorithm>
#include <map>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "tools/run/captures.h"

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

std::vector<PosedImage> PosedImagesOf(const std::vector<Capture>& captures,
                                      const std::vector<CaptureDetection>& detections) {
  if (detections.empty()) return {};  // There are no images.
  CHECK_EQ(captures.size(), detections.size());
  std::vector<PosedImage> images;
  for (size_t i = 0; i < captures.size(); ++i) {
    images.push_back({captures[i].name,
                      {captures[i].base_from_gripper},
                      detections[i].image_digest,
                      !detections[i].detection.ids.empty()});
  }
  return images;
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
            [](const SharedImage& a, const SharedImage& b) { return a.captures.front() < b.captures.front(); });
  return all;
}

size_t FindOtherPose(const std::vector<PosedImage>& images, const SharedImage& shared, size_t image) {
  const auto other = std::find_if(shared.captures.begin(), shared.captures.end(),
                                  [&](size_t i) { return !HaveSamePose(images[i], images[image]); });
  return other == shared.captures.end() ? shared.captures.front() : *other;
}

std::vector<DuplicateImage> FindDuplicates(const std::vector<PosedImage>& images) {
  std::vector<DuplicateImage> duplicates;
  for (const SharedImage& shared : FindSharedImages(images)) {
    const size_t first = shared.captures.front();
    if (!images[first].shows_target) continue;
    for (const size_t i : shared.captures) {
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
    std::map<size_t, PosedImage> image_of;  // By the capture.
    for (const TargetDetection& detection : detections) {
      if (detection.camera != c) continue;
      const Recording& capture = dataset.captures[detection.capture];
      const auto [entry, is_new] = image_of.try_emplace(detection.capture);
      PosedImage& image = entry->second;
      if (is_new) image = {capture.name, capture.base_from_gripper, detection.detection.image_digest, false};
      image.shows_target |= !detection.detection.detection.ids.empty();
    }
    std::vector<size_t> captures;
    std::vector<PosedImage> images;
    for (auto& [capture, image] : image_of) {
      captures.push_back(capture);
      images.push_back(std::move(image));
    }
    for (DuplicateImage& duplicate : FindDuplicates(images)) {
      duplicates.push_back({captures[duplicate.image], c, std::move(duplicate.repeat_of), std::move(duplicate.reason)});
    }
  }
  return duplicates;
}

LeftOutCaptures LeaveOutSharedImages(PairDataset* dataset, std::vector<CaptureDetection>* detections) {
  const std::vector<Capture>& captures = dataset->captures;
  LeftOutCaptures left_out;
  int num_repeats = 0;
  for (const DuplicateImage& duplicate : FindDuplicates(PosedImagesOf(captures, *detections))) {
    ImageResult& result = left_out.results.emplace_back(EntryOfUnused(captures[duplicate.image]));
    const auto num_points = static_cast<int>((*detections)[duplicate.image].detection.ids.size());
    if (num_points > 0) result.targets.push_back({"", num_points, 0, {}, false});
    result.repeat_of = duplicate.repeat_of;
    result.reason = duplicate.reason;
    left_out.indices.push_back(duplicate.image);
    num_repeats += duplicate.repeat_of.empty() ? 0 : 1;
  }
  const int num_contradictory = static_cast<int>(left_out.results.size()) - num_repeats;
  if (num_repeats > 0) {
    left_out.notes.push_back(
        std::to_string(num_repeats) + " of " + std::to_string(captures.size()) +
        " captures repeat the image of another one, byte by byte, and its pose; they do not count");
  }
  if (num_contradictory > 0) {
    left_out.notes.push_back(std::to_string(num_contradictory) + " of " + std::to_string(captures.size()) +
                             " captures share their images, byte by byte, with captures that have another pose; none "
                             "of them is used");
  }
  RemoveAt(left_out.indices, detections);
  RemoveAt(left_out.indices, &dataset->captures);
  return left_out;
}

void InsertLeftOut(const LeftOutCaptures& left_out, std::vector<ImageResult>* results) {
  for (size_t k = 0; k < left_out.indices.size(); ++k) {
    results->insert(results->begin() + static_cast<std::ptrdiff_t>(left_out.indices[k]), left_out.results[k]);
  }
}

}  // namespace heba
