#include "tools/doctor/examination.h"

#include <algorithm>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "solvers/target_pose.h"
#include "tools/captures.h"
#include "tools/run_figures.h"

namespace heba {

std::vector<ExaminedView> ExamineViews(const RunConfig& config, const std::vector<CaptureDetection>& detections,
                                       const Camera& camera) {
  constexpr int kMinPoints = 4;
  const std::vector<Rigid3d> symmetries = config.target->Symmetries();
  std::vector<ExaminedView> views;
  for (size_t i = 0; i < config.captures.size(); ++i) {
    ExaminedView examined;
    examined.capture = i;
    examined.view = {config.captures[i].name,
                     CameraMountFromTargetMount(config.setup, config.captures[i].base_from_gripper),
                     ObservationsOf(*config.target, detections[i].detection), config.captures[i].role};
    if (examined.view.observations.size() < kMinPoints) continue;
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

std::vector<ExaminedView> ViewsOfPoses(const RunConfig& config) {
  std::vector<ExaminedView> views;
  for (size_t i = 0; i < config.captures.size(); ++i) {
    const Capture& capture = config.captures[i];
    const Rigid3d mount = CameraMountFromTargetMount(config.setup, capture.base_from_gripper);
    views.push_back({i, {capture.name, mount, {}, capture.role}, {config.target_poses[i]}, 0});
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

std::vector<size_t> SpreadIndices(size_t count, size_t most) {
  std::vector<size_t> indices;
  const size_t num = std::min(count, most);
  for (size_t i = 0; i < num; ++i) indices.push_back(i * count / num);
  return indices;
}

std::string MisfitText(const PoseConsistency& consistency) {
  return Significant(RadToDeg(consistency.typical_rotation_rad), 2) + " deg and " +
         Significant(1000 * consistency.typical_translation_m, 2) + " mm";
}

std::string HandEyeText(Setup setup, const Rigid3d& camera_mount_from_camera) {
  return std::string(CameraMountName(setup)) + "_from_camera " + PoseText(camera_mount_from_camera);
}

}  // namespace heba
