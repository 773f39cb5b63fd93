#include "tools/doctor/examination.h"

#include <algorithm>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/image_detection.h"
#include "solvers/initial/target_pose.h"
#include "tools/files/cached_detector.h"
#include "tools/run/captures.h"
#include "tools/text/result_text.h"
#include "tools/text/run_console.h"

namespace heba {

Examination Corrected(Examination examination, Checked checked) {
  if (checked.config) examination.config = std::move(*checked.config);
  if (checked.detections) examination.detections = std::move(*checked.detections);
  if (checked.camera) examination.camera = std::move(checked.camera);
  if (checked.views) examination.views = std::move(*checked.views);
  if (checked.pose_fit) examination.pose_fit = std::move(checked.pose_fit);
  return examination;
}

std::vector<TargetDetection> Detections(const RunConfig& config, int num_threads, Verbosity verbosity) {
  ProgressObserver observer(verbosity);
  return DetectDataset(config.data, CachedDetections(config.data, config.targets_used), num_threads, &observer);
}

size_t NumSeen(const std::vector<TargetDetection>& detections) {
  return static_cast<size_t>(std::count_if(detections.begin(), detections.end(), [](const TargetDetection& seen) {
    return static_cast<int>(seen.detection.detection.ids.size()) >= kMinPosePoints;
  }));
}

std::vector<ExaminedView> ExamineViews(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                                       const Camera& camera) {
  const Target& target = *dataset.targets.front();
  const std::vector<Rigid3d> symmetries = target.Symmetries();
  std::vector<ExaminedView> views;
  for (const TargetDetection& seen : detections) {
    ExaminedView examined;
    examined.capture = seen.capture;
    examined.view = ViewOf(dataset, seen.capture, ObservationsOf(target, seen.detection.detection));
    if (examined.view.observations.size() < kMinPosePoints) continue;
    const std::vector<TargetPose> poses = EstimateTargetPose(camera, examined.view.observations);
    if (poses.empty()) continue;
    for (const TargetPose& pose : poses) {
      for (const Rigid3d& symmetry : symmetries) {
        examined.camera_from_target.push_back(pose.camera_from_target * symmetry);
      }
    }
    examined.rms_px = poses.front().rms_px;
    views.push_back(std::move(examined));
  }
  return views;
}

std::vector<ExaminedView> ViewsOfPoses(const Dataset& dataset) {
  std::vector<ExaminedView> views;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    views.push_back({i, ViewOf(dataset, i, {}), {dataset.target_poses[i]}, 0});
  }
  return views;
}

std::vector<PoseCandidates> CandidatesOf(const std::vector<ExaminedView>& views) {
  std::vector<PoseCandidates> candidates;
  for (const ExaminedView& view : views) {
    candidates.push_back({view.view.camera_mount_from_target_mount, view.camera_from_target});
  }
  return candidates;
}

double WorkingDistanceM(const std::vector<ExaminedView>& views) {
  double sum_m = 0;
  for (const ExaminedView& view : views) sum_m += view.camera_from_target.front().translation.norm();
  return sum_m / static_cast<double>(views.size());
}

std::string MisfitText(const PoseConsistency& consistency) {
  return Significant(RadToDeg(consistency.typical_rotation_rad), 2) + " deg and " +
         Significant(1000 * consistency.typical_translation_m, 2) + " mm";
}

std::string HandEyeText(Setup setup, const Rigid3d& camera_mount_from_camera) {
  return std::string(CameraMountName(setup)) + "_from_camera " + PoseText(camera_mount_from_camera);
}

}  // namespace heba
