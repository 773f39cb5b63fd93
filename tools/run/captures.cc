#include "tools/run/captures.h"

#include <algorithm>
#include <utility>

#include "heba/data/hand_eye.h"
#include "tools/run/earlier_run.h"
#include "tools/run/free_points.h"

namespace heba {

bool IsSinglePair(const Dataset& dataset) {
  const Problem& rig = dataset.rig;
  return rig.cameras.size() == 1 && rig.targets.size() == 1 && rig.robots.size() == 1 &&
         MovesAgainst(rig.cameras.front().mount, rig.targets.front().mount);
}

Setup SetupOf(const Dataset& dataset) { return SetupOf(dataset.rig.cameras.front().mount); }

bool IsImageSizeKnown(const Dataset& dataset) {
  return std::all_of(
      dataset.given_detections.begin(), dataset.given_detections.end(), [&](const TargetDetection& given) {
        const CaptureDetection& detection = given.detection;
        return (detection.width_px > 0 && detection.height_px > 0) ||
               (dataset.has_camera[given.camera] && dataset.rig.cameras[given.camera].camera.width_px > 0);
      });
}

ScaleSigmas ScaleSigmasOf(const Dataset& dataset, const Problem& solved) {
  ScaleSigmas sigmas;
  for (const std::shared_ptr<const Target>& target : dataset.targets) {
    sigmas.targets.push_back(target->scale_sigma().value_or(kTargetScaleSigma));
  }
  for (size_t r = 0; r < solved.robots.size(); ++r) {
    const SharedEffects* const effects = EffectsOf(solved, r);
    const bool is_calibrated = effects != nullptr && effects->kind == SharedEffectsKind::kArm;
    const std::optional<double> stated =
        dataset.robot_scale_sigmas.empty() ? std::nullopt : dataset.robot_scale_sigmas[r];
    sigmas.robots.push_back(stated.value_or(is_calibrated ? kCalibratedRobotScaleSigma : kRobotScaleSigma));
  }
  return sigmas;
}

double RobotScaleSigmaOf(const Dataset& dataset) {
  const std::vector<double> sigmas = ScaleSigmasOf(dataset, dataset.rig).robots;
  return *std::max_element(sigmas.begin(), sigmas.end());
}

std::string ImageOf(const Dataset& dataset, size_t capture, size_t camera) {
  const Recording& recording = dataset.captures[capture];
  const std::filesystem::path& image = recording.images[camera];
  return image.empty() ? recording.name : image.filename().string();
}

Dataset WithoutCaptures(Dataset dataset, const std::map<size_t, std::string>& reason_of) {
  if (reason_of.empty()) return dataset;
  std::vector<Recording> captures;
  std::vector<Rigid3d> target_poses;
  std::vector<std::optional<size_t>> place_of;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    Recording& capture = dataset.captures[i];
    const auto reason = reason_of.find(i);
    if (reason != reason_of.end()) {
      place_of.emplace_back();
      dataset.left_out.push_back({capture.name, reason->second, capture.name, std::move(capture.images)});
      continue;
    }
    place_of.emplace_back(captures.size());
    captures.push_back(std::move(capture));
    if (!dataset.target_poses.empty()) target_poses.push_back(dataset.target_poses[i]);
  }
  dataset.captures = std::move(captures);
  dataset.target_poses = std::move(target_poses);
  std::erase_if(dataset.given_detections, [&](TargetDetection& detection) {
    const std::optional<size_t> place = place_of[detection.capture];
    detection.capture = place.value_or(0);
    return !place;
  });
  return dataset;
}

std::vector<std::shared_ptr<const PoseEffect>> EffectsAt(const Dataset& dataset, const SmoothErrors& errors) {
  std::vector<std::shared_ptr<const PoseEffect>> effects;
  for (const Recording& capture : dataset.captures) {
    effects.push_back(errors.EffectAt(capture.base_from_gripper.front()));
  }
  return effects;
}

View ViewOf(const Dataset& dataset, size_t capture, Observations observations, const EffectsOfCaptures& effects) {
  const Recording& from = dataset.captures[capture];
  View view{from.name, CameraMountFromTargetMount(SetupOf(dataset), from.base_from_gripper.front()),
            std::move(observations), from.role, capture};
  if (!effects.effects.empty()) view.effect = effects.effects[capture];
  if (!effects.gripper_by_joints.empty()) view.gripper_by_joints = effects.gripper_by_joints[capture];
  if (!from.joints.empty()) view.joints = from.joints.front();
  return view;
}

std::vector<View> ViewsOf(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                          const EffectsOfCaptures& effects) {
  std::vector<View> views;
  for (const TargetDetection& seen : detections) {
    const Detection& detection = seen.detection.detection;
    if (detection.ids.empty()) continue;
    views.push_back(ViewOf(dataset, seen.capture, ObservationsOf(*dataset.targets.front(), detection), effects));
  }
  return views;
}

PredictedImages PredictCaptures(const Dataset& dataset, const std::vector<TargetDetection>& detections,
                                const EffectsOfCaptures& effects, const PairSolution& solution, double rms_px) {
  PredictedImages predicted{{solution.camera}, {solution.shape}, {}, {rms_px}};
  for (const TargetDetection& detection : detections) {
    const View view = ViewOf(dataset, detection.capture, {}, effects);
    predicted.camera_from_target.push_back(
        CameraFromTarget(solution.hand_eye, CorrectedMount(SetupOf(dataset), view, solution)));
  }
  return predicted;
}

PairCalibrationOptions OptionsOf(const Dataset& dataset, const RunOptions& run) {
  const ProblemCamera& camera = dataset.rig.cameras.front();
  const ProblemTarget& of_target = dataset.rig.targets.front();
  const Target& target = *dataset.targets.front();
  const AdjustmentOptions& adjustment = run.calibration.adjustment;
  PairCalibrationOptions options;
  options.methods = run.methods;
  options.seed = run.seed;
  // A noise without a prior is chosen from the captures, unless smooth errors, or noisy joints, are wanted beside it.
  options.choose.robot_noise = adjustment.robot == BundleOptions::Robot::kEstimatedNoise &&
                               run.calibration.smooth != SmoothPoseErrors::kAlways && !run.joint_noise &&
                               !adjustment.robot_noise_prior;
  options.choose.target_shape = run.calibration.choose_target_shape;
  BundleOptions& bundle = options.bundle;
  static_cast<AdjustmentOptions&>(bundle) = adjustment;
  if (options.choose.robot_noise) bundle.robot = BundleOptions::Robot::kExact;
  bundle.num_threads = run.num_threads;
  bundle.free_intrinsics = camera.free_intrinsics;
  bundle.camera_prior = camera.prior;
  bundle.free_shape = GroupsOfSurface(of_target.free_shape);
  bundle.target_scale_sigma = of_target.scale_sigma;
  bundle.known_target_scale_sigma = target.scale_sigma().value_or(kTargetScaleSigma);
  const bool has_camera = dataset.has_camera.front();
  if (has_camera) options.camera = camera.camera;
  options.choose_camera_model = !has_camera && camera.camera.model.empty();
  options.camera_model = camera.camera.model;
  options.setup = SetupOf(dataset);
  options.width_px = camera.camera.width_px;
  options.height_px = camera.camera.height_px;
  options.symmetries = target.Symmetries();
  options.shape = DesignedShape(AllPoints(target).points_in_target);
  options.has_smooth_remainder = run.calibration.smooth != SmoothPoseErrors::kNone;
  if (!run.earlier) return options;
  Problem problem = HandEyeProblem(options.setup, camera.camera, options.shape);
  problem.targets.front().symmetries = options.symmetries;
  problem = WithPrior(std::move(problem), *run.earlier);
  bundle.prior = problem.prior;
  options.symmetries = problem.targets.front().symmetries;
  options.shape = problem.targets.front().shape;
  return options;
}

}  // namespace heba
