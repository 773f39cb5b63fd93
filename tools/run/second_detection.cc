#include "tools/run/second_detection.h"

#include <algorithm>
#include <mutex>
#include <string>

#include <opencv2/core.hpp>

#include "heba/base/parallel.h"
#include "heba/evaluation/metrics.h"
#include "targets/guided_detection.h"
#include "targets/images/image.h"
#include "tools/run/captures.h"

namespace heba {

std::vector<std::optional<Eigen::Vector2d>> ExpectedPixels(const Target& target, const Solution& solution,
                                                           const Rigid3d& camera_from_target) {
  constexpr double kRimPx = 3;
  std::vector<std::optional<Eigen::Vector2d>> expected;
  const bool z_out = target.Draw().y_up;
  const Eigen::Vector3d normal = camera_from_target.rotation * Eigen::Vector3d(0, 0, z_out ? -1 : 1);
  for (const TargetPoint& point : target.points()) {
    const Eigen::Vector3d in_camera = camera_from_target * ApplyShape(point.in_target, solution.shape);
    std::optional<Eigen::Vector2d> pixel = ProjectPoint(solution.camera, in_camera);
    // The back of the target shows no points, and strong distortion folds far rays back into the image.
    const bool is_visible = pixel && normal.dot(in_camera) > 0 && pixel->x() >= kRimPx && pixel->y() >= kRimPx &&
                            pixel->x() <= solution.camera.width_px - 1 - kRimPx &&
                            pixel->y() <= solution.camera.height_px - 1 - kRimPx &&
                            UnprojectPixel(solution.camera, *pixel).value_or(Eigen::Vector3d::Zero()).dot(in_camera) >
                                0.999 * in_camera.norm();
    expected.push_back(is_visible ? pixel : std::nullopt);
  }
  return expected;
}

std::optional<std::vector<CaptureDetection>> DetectAgain(const Dataset& dataset,
                                                         const std::vector<CaptureDetection>& detections,
                                                         const Calibration& calibration, int num_threads,
                                                         RunObserver* observer) {
  // A target with symmetries has no ids that a second pass could complete.
  if (dataset.target->Symmetries().size() > 1 || !dataset.given_detections.empty()) return std::nullopt;
  const Solution& solution = *calibration.refined;
  const std::optional<SquaredErrors> errors =
      ReprojectionErrors(solution.hand_eye, solution.camera,
                         ApplyShape(CorrectedViews(dataset.setup, calibration.views, solution), solution.shape));
  if (!errors) return std::nullopt;
  constexpr double kMinTolerancePx = 2;
  constexpr double kToleranceRatio = 4;  // Relative to the captures' RMS, which includes the robot noise.
  const double tolerance_px = std::max(kMinTolerancePx, kToleranceRatio * errors->RmsPx().value_or(0));
  std::vector<size_t> incomplete;
  std::vector<std::vector<std::optional<Eigen::Vector2d>>> expected(dataset.captures.size());
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    expected[i] = ExpectedPixels(*dataset.target, solution, PredictedPose(dataset, solution, i));
    const auto num_expected =
        std::count_if(expected[i].begin(), expected[i].end(), [](const auto& pixel) { return pixel.has_value(); });
    if (static_cast<size_t>(num_expected) > detections[i].detection.ids.size()) incomplete.push_back(i);
  }
  if (incomplete.empty()) return std::nullopt;
  StageReport report(RunStage::kSecondDetection, static_cast<int>(incomplete.size()), observer);
  std::vector<CaptureDetection> again = detections;
  std::mutex mutex;
  bool has_changed = false;
  ParallelFor(static_cast<int>(incomplete.size()), num_threads, [&](int k) {
    const size_t i = incomplete[static_cast<size_t>(k)];
    const cv::Mat grey = ReadGreyImage(dataset.captures[i].image);
    cv::theRNG() = cv::RNG(static_cast<uint64_t>(i) + 1);
    GuidedDetection guided = DetectGuided(*dataset.target, grey, detections[i].detection, expected[i], tolerance_px);
    const std::lock_guard<std::mutex> lock(mutex);
    if (guided.num_added > 0 || guided.num_dropped > 0) {
      has_changed = true;
      if (guided.num_dropped > 0) {
        guided.detection.reason += std::string(guided.detection.reason.empty() ? "" : "; ") +
                                   std::to_string(guided.num_dropped) +
                                   " points rejected that are not where the other captures predict them";
      }
      again[i].detection = std::move(guided.detection);
      again[i].num_second_pass = guided.num_added;
    }
    report.Step();
  });
  if (!has_changed) return std::nullopt;
  return again;
}

}  // namespace heba
