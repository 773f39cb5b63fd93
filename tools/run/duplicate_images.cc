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

bool HaveSamePose(const Capture& a, const Capture& b) {
  return DistanceM(a.base_from_gripper, b.base_from_gripper) <= kSamePoseM &&
         AngleRad(a.base_from_gripper, b.base_from_gripper) <= kSamePoseRad;
}

template <typename T>
void RemoveAt(const std::vector<size_t>& indices, std::vector<T>* values) {
  for (auto index = indices.rbegin(); index != indices.rend(); ++index) {
    values->erase(values->begin() + static_cast<std::ptrdiff_t>(*index));
  }
}

}  // namespace

std::vector<SharedImage> FindSharedImages(const std::vector<Capture>& captures,
                                          const std::vector<CaptureDetection>& detections) {
  if (detections.empty()) return {};  // There are no images.
  CHECK_EQ(captures.size(), detections.size());
  std::map<std::string, std::vector<size_t>> captures_of;
  for (size_t i = 0; i < captures.size(); ++i) {
    if (!detections[i].image_digest.empty()) captures_of[detections[i].image_digest].push_back(i);
  }
  std::vector<SharedImage> all;
  for (const auto& entry : captures_of) {
    const std::vector<size_t>& sharing = entry.second;
    if (sharing.size() < 2) continue;
    const bool has_one_pose = std::all_of(
        sharing.begin(), sharing.end(), [&](size_t i) { return HaveSamePose(captures[sharing.front()], captures[i]); });
    all.push_back({sharing, has_one_pose});
  }
  std::sort(all.begin(), all.end(),
            [](const SharedImage& a, const SharedImage& b) { return a.captures.front() < b.captures.front(); });
  return all;
}

size_t FindOtherPose(const std::vector<Capture>& captures, const SharedImage& shared, size_t capture) {
  const auto other = std::find_if(shared.captures.begin(), shared.captures.end(),
                                  [&](size_t i) { return !HaveSamePose(captures[i], captures[capture]); });
  return other == shared.captures.end() ? shared.captures.front() : *other;
}

LeftOutCaptures LeaveOutSharedImages(Dataset* dataset, std::vector<CaptureDetection>* detections) {
  const std::vector<Capture>& captures = dataset->captures;
  std::map<size_t, CaptureResult> results;
  int num_repeats = 0;
  int num_contradictory = 0;
  for (const SharedImage& shared : FindSharedImages(captures, *detections)) {
    // Images that show no target, such as black ones, need not be left out.
    if ((*detections)[shared.captures.front()].detection.ids.empty()) continue;
    for (const size_t i : shared.captures) {
      if (shared.has_one_pose && i == shared.captures.front()) continue;
      CaptureResult& result = results[i];
      result.image = captures[i].name;
      result.role = captures[i].role;
      result.num_points = static_cast<int>((*detections)[i].detection.ids.size());
      if (shared.has_one_pose) {
        ++num_repeats;
        result.repeat_of = captures[shared.captures.front()].name;
        result.reason = "the same image as " + result.repeat_of + ", byte by byte";
      } else {
        ++num_contradictory;
        result.reason = "the same image as " + captures[FindOtherPose(captures, shared, i)].name +
                        ", byte by byte, but with another pose of the robot: at most one of the poses belongs to the "
                        "image, so no capture with this image is used";
      }
    }
  }
  LeftOutCaptures left_out;
  for (auto& [index, result] : results) {
    left_out.indices.push_back(index);
    left_out.results.push_back(std::move(result));
  }
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

void InsertLeftOut(const LeftOutCaptures& left_out, std::vector<CaptureResult>* results) {
  for (size_t k = 0; k < left_out.indices.size(); ++k) {
    results->insert(results->begin() + static_cast<std::ptrdiff_t>(left_out.indices[k]), left_out.results[k]);
  }
}

}  // namespace heba
