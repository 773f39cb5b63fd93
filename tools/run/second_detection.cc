#include "tools/run/second_detection.h"

#include <algorithm>
#include <limits>
#include <mutex>
#include <string>
#include <utility>

#include <opencv2/core.hpp>

#include "heba/base/parallel.h"
#include "targets/guided_detection.h"
#include "targets/images/image.h"
#include "tools/run/run_stage.h"

namespace heba {
namespace {

using ExpectedPixels = std::vector<std::optional<Eigen::Vector2d>>;

// Returns the direction that points away from whoever looks at the front of a target.
Eigen::Vector3d AwayFromFront(const Target& target) { return {0, 0, target.Draw().y_up ? -1.0 : 1.0}; }

// Predicts the target's points in the image of a detection, px; nothing for points out of view.
ExpectedPixels ExpectedIn(const Target& target, const PredictedImages& predicted,
                          const std::vector<TargetDetection>& detections, size_t index) {
  constexpr double kRimPx = 3;
  const Camera& camera = predicted.cameras[detections[index].camera];
  const TargetShape& shape = predicted.shapes[detections[index].target];
  const Rigid3d camera_from_target = *predicted.camera_from_target[index];
  ExpectedPixels expected;
  const Eigen::Vector3d normal = camera_from_target.rotation * AwayFromFront(target);
  for (const TargetPoint& point : target.points()) {
    const Eigen::Vector3d in_camera = camera_from_target * ApplyShape(point.in_target, shape);
    std::optional<Eigen::Vector2d> pixel = ProjectPoint(camera, in_camera);
    // The back of the target shows no points, and strong distortion folds far rays back into the image.
    const bool is_visible =
        pixel && normal.dot(in_camera) > 0 && pixel->x() >= kRimPx && pixel->y() >= kRimPx &&
        pixel->x() <= camera.width_px - 1 - kRimPx && pixel->y() <= camera.height_px - 1 - kRimPx &&
        UnprojectPixel(camera, *pixel).value_or(Eigen::Vector3d::Zero()).dot(in_camera) > 0.999 * in_camera.norm();
    expected.push_back(is_visible ? pixel : std::nullopt);
  }
  return expected;
}

// The counts of one target's points over all images that show some of it.
struct PointCounts {
  std::vector<int> expected;
  std::vector<int> found;
};

PointCounts CountPoints(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                        const PredictedImages& predicted, size_t target) {
  const std::vector<TargetPoint>& points = dataset.targets[target]->points();
  PointCounts counts{std::vector<int>(points.size(), 0), std::vector<int>(points.size(), 0)};
  for (size_t i = 0; i < detections.size(); ++i) {
    const std::vector<int>& ids = detections[i].detection.detection.ids;
    if (detections[i].target != target || ids.empty() || !predicted.camera_from_target[i]) continue;
    const ExpectedPixels expected = ExpectedIn(*dataset.targets[target], predicted, detections, i);
    for (size_t k = 0; k < points.size(); ++k) {
      counts.expected[k] += expected[k] ? 1 : 0;
      counts.found[k] += std::count(ids.begin(), ids.end(), points[k].id) > 0 ? 1 : 0;
    }
  }
  return counts;
}

}  // namespace

PredictedImages PredictImages(const Problem& problem, const Solution& solution,
                              const std::vector<TargetDetection>& detections, std::vector<double> rms_px) {
  PredictedImages predicted{solution.cameras, solution.shapes, {}, std::move(rms_px)};
  for (const TargetDetection& detection : detections) {
    const ProblemCapture& capture = problem.captures[detection.capture];
    std::optional<Rigid3d>& pose = predicted.camera_from_target.emplace_back();
    const bool is_used = std::any_of(capture.images.begin(), capture.images.end(), [&](const ProblemImage& image) {
      return image.camera == detection.camera && image.target == detection.target && image.observations.size() > 0;
    });
    if (!is_used && !detection.detection.detection.ids.empty()) continue;
    pose = CameraFromTarget(problem, solution.poses, detection.camera, detection.target,
                            WithErrors(capture, solution.effects));
  }
  return predicted;
}

std::optional<std::vector<TargetDetection>> DetectAgain(const Dataset& dataset,
                                                        const std::vector<TargetDetection>& detections,
                                                        const PredictedImages& predicted, int num_threads,
                                                        RunObserver* observer) {
  if (!dataset.given_detections.empty()) return std::nullopt;
  std::vector<size_t> incomplete;
  std::vector<ExpectedPixels> expected(detections.size());
  for (size_t i = 0; i < detections.size(); ++i) {
    const Target& target = *dataset.targets[detections[i].target];
    if (target.Symmetries().size() > 1 || !predicted.camera_from_target[i]) continue;
    expected[i] = ExpectedIn(target, predicted, detections, i);
    const auto num_expected =
        std::count_if(expected[i].begin(), expected[i].end(), [](const auto& pixel) { return pixel.has_value(); });
    if (static_cast<size_t>(num_expected) > detections[i].detection.detection.ids.size()) incomplete.push_back(i);
  }
  if (incomplete.empty()) return std::nullopt;
  StageReport report(RunStage::kSecondDetection, static_cast<int>(incomplete.size()), observer);
  std::vector<TargetDetection> again = detections;
  std::mutex mutex;
  bool has_changed = false;
  ParallelFor(static_cast<int>(incomplete.size()), num_threads, [&](int k) {
    constexpr double kMinTolerancePx = 2;
    constexpr double kToleranceRatio = 4;  // Relative to the camera's RMS, which includes the robot noise.
    const size_t i = incomplete[static_cast<size_t>(k)];
    TargetDetection& detection = again[i];
    const cv::Mat grey = ReadGreyImage(dataset.captures[detection.capture].images[detection.camera]);
    cv::theRNG() = cv::RNG(static_cast<uint64_t>(i) + 1);
    GuidedDetection guided =
        DetectGuided(*dataset.targets[detection.target], grey, detection.detection.detection, expected[i],
                     std::max(kMinTolerancePx, kToleranceRatio * predicted.rms_px[detection.camera]));
    const std::lock_guard<std::mutex> lock(mutex);
    if (guided.num_added > 0 || guided.num_dropped > 0) {
      has_changed = true;
      if (guided.num_dropped > 0) {
        guided.detection.reason += std::string(guided.detection.reason.empty() ? "" : "; ") +
                                   std::to_string(guided.num_dropped) +
                                   " points rejected that are not where the other captures predict them";
      }
      detection.detection.detection = std::move(guided.detection);
      detection.detection.num_second_pass = guided.num_added;
    }
    report.Step();
  });
  if (!has_changed) return std::nullopt;
  return again;
}

std::vector<Finding> FindSeenFromBehind(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                                        const PredictedImages& predicted) {
  std::vector<Finding> findings;
  for (size_t t = 0; t < dataset.targets.size(); ++t) {
    const Eigen::Vector3d away = AwayFromFront(*dataset.targets[t]);
    int num_images = 0;
    int num_behind = 0;
    for (size_t i = 0; i < detections.size(); ++i) {
      const std::optional<Rigid3d>& camera_from_target = predicted.camera_from_target[i];
      if (detections[i].target != t || detections[i].detection.detection.ids.empty() || !camera_from_target) continue;
      ++num_images;
      const Eigen::Vector3d away_in_camera = camera_from_target->rotation * away;
      num_behind += away_in_camera.dot(camera_from_target->translation) < 0 ? 1 : 0;
    }
    if (2 * num_behind <= num_images) continue;
    Finding& finding = findings.emplace_back();
    finding.grade = Grade::kDoubtful;
    finding.code = FindingCode("seen_from_behind");
    finding.numbers = {{"behind", num_behind}, {"images", num_images}};
    finding.is_cause = true;
    const std::string& name = dataset.rig.targets[t].name;
    if (!name.empty()) finding.names = {{"of_target", name}};
  }
  return findings;
}

std::vector<Finding> FindMissingIds(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                                    const PredictedImages& predicted) {
  constexpr int kOften = 5;
  constexpr double kShare = 0.1;
  std::vector<Finding> findings;
  if (!dataset.given_detections.empty()) return findings;
  for (size_t t = 0; t < dataset.targets.size(); ++t) {
    const PointCounts counts = CountPoints(dataset, detections, predicted, t);
    int num_missing = 0;
    int least_expected = std::numeric_limits<int>::max();
    for (size_t k = 0; k < counts.found.size(); ++k) {
      if (counts.found[k] > 0 || counts.expected[k] < kOften) continue;
      ++num_missing;
      least_expected = std::min(least_expected, counts.expected[k]);
    }
    const auto num_points = static_cast<double>(counts.found.size());
    if (num_missing < kShare * num_points || num_missing == 0) continue;
    findings.push_back({Grade::kDoubtful,
                        FindingCode("missing_ids"),
                        {{"missing", num_missing}, {"points", num_points}, {"images", least_expected}}});
    const std::string& name = dataset.rig.targets[t].name;
    if (!name.empty()) findings.back().names.emplace_back("of_target", name);
  }
  return findings;
}

}  // namespace heba
