#include "tools/run/cell_result.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "heba/base/units.h"
#include "heba/cross_validation.h"
#include "heba/evaluation/metrics.h"
#include "solvers/calibration/held_out.h"
#include "tools/run/arm_errors.h"
#include "tools/run/cell_images.h"
#include "tools/run/run_stage.h"

namespace heba {
namespace {

PoseError ErrorOf(const Rigid3d& pose, const Rigid3d& truth) {
  return {1000 * DistanceM(pose, truth), RadToDeg(AngleRad(pose, truth))};
}

// Returns the error of a target's pose, in the nearest of the orientations in which it looks the same.
PoseError ErrorOfTarget(const Rigid3d& pose, const std::vector<Rigid3d>& symmetries, const Rigid3d& truth) {
  std::vector<PoseError> errors;
  for (const Rigid3d& symmetry : symmetries) errors.push_back(ErrorOf(pose * symmetry, truth));
  return *std::min_element(errors.begin(), errors.end(),
                           [](const PoseError& a, const PoseError& b) { return a.deg < b.deg; });
}

// Returns the errors of the poses of a result by the truth.
CellPoseErrors PoseErrors(const Problem& rig, const RunResult& result, const CellTruth& truth) {
  CellPoseErrors errors;
  const CellPoses& poses = result.solution.poses;
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    errors.targets.emplace_back();
    if (!truth.mount_from_target[t]) continue;
    errors.targets.back() =
        ErrorOfTarget(poses.mount_from_target[t], rig.targets[t].symmetries, *truth.mount_from_target[t]);
  }
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    errors.bases.emplace_back();
    if (r > 0 && truth.world_from_base[r]) {
      errors.bases.back() = ErrorOf(poses.world_from_base[r], *truth.world_from_base[r]);
    }
  }
  // The poses of the cameras in the world or, if a gripper carries them, in that gripper.
  std::map<std::string, std::optional<Rigid3d>> true_pose_of;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const Mount& mount = rig.cameras[c].mount;
    std::optional<Rigid3d> pose = truth.mount_from_camera[c];
    if (mount.part == Mount::Part::kBase && mount.robot > 0) {
      const std::optional<Rigid3d>& base = truth.world_from_base[mount.robot];
      pose = base ? std::optional(*base * *pose) : std::nullopt;
    }
    true_pose_of[rig.cameras[c].name] = pose;
  }
  for (const RelativePose& relative : result.relative_cameras) {
    const std::optional<Rigid3d>& parent = true_pose_of[relative.parent];
    const std::optional<Rigid3d>& child = true_pose_of[relative.child];
    errors.relative_cameras.emplace_back();
    if (parent && child) {
      errors.relative_cameras.back() = ErrorOf(relative.parent_from_child, Inverse(*parent) * *child);
    }
  }
  return errors;
}

// Returns the in-sample errors of every camera, with the poses of the arms as given.
std::vector<CameraErrors> InSampleErrors(const Problem& used, const Solution& solution) {
  std::vector<CameraErrors> all;
  const std::vector<SquaredErrors> sums = ErrorsOfCameras(used, solution);
  for (size_t c = 0; c < sums.size(); ++c) {
    CameraErrors& errors = all.emplace_back();
    errors.reprojection_rms_px = sums[c].RmsPx();
    const std::vector<Rigid3d> poses = TargetPosesOf(used, solution.poses, solution.effects, c);
    if (!poses.empty()) errors.distance_m = WorkingDistance(poses);
  }
  return all;
}

// Returns the errors of the cameras with those of the images that contradict the others. `seen` has the points of all
// images.
std::vector<CameraErrors> WithLeftOutErrors(std::vector<CameraErrors> errors, const Problem& seen,
                                            const Calibration& calibration) {
  ImageSet left_out;
  for (const UnusedProblemImage& unused : calibration.unused) {
    for (size_t k = 0; k < seen.captures[unused.capture].images.size(); ++k) {
      if (!unused.image || *unused.image == k) left_out.insert({unused.capture, k});
    }
  }
  for (size_t c = 0; c < errors.size(); ++c) {
    ImageSet of_camera = left_out;
    // A motion of the camera is stated by itself.
    for (const MovedCamera& moved : calibration.moved) {
      std::erase_if(of_camera, [&](const std::pair<size_t, size_t>& image) {
        return moved.camera == c &&
               std::find(moved.left_out.begin(), moved.left_out.end(), image.first) != moved.left_out.end();
      });
    }
    errors[c] = WithLeftOut(errors[c], ErrorsOfUnused(seen, *calibration.refined, of_camera, c));
  }
  return errors;
}

// Returns the description and the poses of the rig, without captures and figures.
RunResult PosesResult(const Dataset& dataset, const Calibration& calibration) {
  RunResult result;
  result.name = dataset.name;
  result.about = dataset.about;
  result.rig = calibration.problem;
  result.rig.captures.clear();
  // The basis of smooth errors is not written.
  for (std::shared_ptr<const SharedEffects>& effects : result.rig.effects) {
    if (effects != nullptr && effects->kind == SharedEffectsKind::kSmooth) effects = nullptr;
  }
  for (const std::shared_ptr<const Target>& target : dataset.targets) {
    result.target_types.push_back(std::string(target->type()));
    result.num_target_points.push_back(static_cast<int>(target->points().size()));
  }
  result.solution = WithEffectsOf(result.rig, *calibration.refined);
  result.solution.captures.clear();
  result.relative_cameras = RelativeCameraPoses(result.rig, result.solution);
  result.relative_targets = RelativeTargetPoses(result.rig, result.solution);
  result.relative_bases = RelativeBasePoses(result.rig, result.solution);
  return result;
}

// Returns the errors of the cameras with those of held-out images.
std::vector<CameraErrors> WithHoldOuts(std::vector<CameraErrors> errors, const std::vector<CameraHoldOut>& hold_outs) {
  for (size_t c = 0; c < hold_outs.size(); ++c) {
    const CameraHoldOut& camera = hold_outs[c];
    errors[c].holdout_rms_px = camera.rms_px;
    if (camera.target_m) errors[c].holdout_target_mm = 1000 * *camera.target_m;
    if (camera.target_rad) errors[c].holdout_target_deg = RadToDeg(*camera.target_rad);
    errors[c].holdout_reason = camera.reason;
  }
  return errors;
}

}  // namespace

FormOfResult CellForm(const ImageRun& run, const CalibratedImages& calibrated, const Problem& used) {
  const Dataset& dataset = run.dataset;
  const Calibration& calibration = calibrated.calibration;
  FormOfResult form;
  RunResult& result = form.result;
  result = PosesResult(dataset, calibration);
  result.errors = WithLeftOutErrors(InSampleErrors(used, *calibration.refined), calibrated.seen, calibration);
  const int num_folds = std::min(run.options.folds, static_cast<int>(calibration.problem.captures.size()));
  if (num_folds > 1) {
    StageReport report(RunStage::kHoldOut, num_folds, run.observer);
    const HoldOuts hold_outs =
        CrossValidate(calibration, CellOptions(run, calibrated.arms), num_folds, [&] { report.Step(); });
    result.errors = WithHoldOuts(std::move(result.errors), hold_outs.of_cameras);
    result.holdout_chi2 = hold_outs.chi2_per_dof;
    for (const CameraHoldOut& camera : hold_outs.of_cameras) form.held_out_m.push_back(camera.target_m_of_capture);
  }
  ArmSummaries summaries = SummariseArms(dataset, calibrated.arms, run.options.kinematics, calibration);
  result.arms = std::move(summaries.arms);
  form.of_calibration = WithNamesOfArms(calibrated.findings, result.arms, result.rig.robots);
  form.of_arms = std::move(summaries.findings);
  return form;
}

RunResult WithTruth(RunResult result, const CellTruth& truth, const Problem& problem) {
  for (size_t c = 0; c < result.errors.size(); ++c) {
    const PoseError error = ErrorOf(result.solution.poses.mount_from_camera[c], truth.mount_from_camera[c]);
    result.errors[c].truth_mm = error.mm;
    result.errors[c].truth_deg = error.deg;
  }
  result.truth = PoseErrors(problem, result, truth);
  return result;
}

}  // namespace heba
