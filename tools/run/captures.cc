#include "tools/run/captures.h"

#include <algorithm>
#include <utility>

#include "heba/data/hand_eye.h"
#include "heba/image_detection.h"

namespace heba {
namespace {

bool StatesSize(const CaptureDetection& detection) { return detection.width_px > 0 && detection.height_px > 0; }

}  // namespace

bool IsImageSizeKnown(const Dataset& dataset) {
  return (dataset.camera && dataset.camera->width_px > 0) ||
         std::all_of(dataset.given_detections.begin(), dataset.given_detections.end(), StatesSize);
}

RigDataset AsRigDataset(const Dataset& dataset) {
  RigDataset whole;
  whole.name = dataset.name;
  whole.rig = HandEyeProblem(dataset.setup, dataset.camera.value_or(Camera()), TargetShape());
  whole.has_camera = {dataset.camera.has_value()};
  whole.camera_sources = {dataset.camera_source};
  whole.targets = {dataset.target};
  for (const Capture& capture : dataset.captures) {
    whole.captures.push_back({capture.name, {capture.base_from_gripper}, {capture.image}, {capture.joints}});
  }
  whole.given_detections = InRig(dataset.given_detections);
  whole.detections_source = dataset.detections_source;
  whole.arms = {dataset.robot};
  whole.robot_scale_sigmas = {dataset.robot_scale_sigma};
  return whole;
}

ScaleSigmas ScaleSigmasOf(const RigDataset& dataset, const RigProblem& solved) {
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

std::vector<RigDetection> InRig(const std::vector<CaptureDetection>& detections) {
  std::vector<RigDetection> all;
  for (size_t i = 0; i < detections.size(); ++i) all.push_back({i, 0, 0, detections[i]});
  return all;
}

std::vector<CaptureDetection> OutOfRig(std::vector<RigDetection> detections) {
  std::vector<CaptureDetection> all;
  for (RigDetection& detection : detections) all.push_back(std::move(detection.detection));
  return all;
}

std::vector<CaptureDetection> DetectCaptures(const Dataset& dataset, const DetectFunction& detect, int num_threads,
                                             RunObserver* observer) {
  return OutOfRig(DetectRig(AsRigDataset(dataset), {detect}, num_threads, observer));
}

void FitCameraToImages(const std::vector<CaptureDetection>& detections, Dataset* dataset) {
  if (!dataset->camera) return;
  const RigDataset whole = AsRigDataset(*dataset);
  RigProblem rig = whole.rig;
  FitCamerasToImages(whole, InRig({detections.front()}), &rig);
  dataset->camera = rig.cameras[0].camera;
}

View ViewOf(const Dataset& dataset, size_t capture, Observations observations) {
  const Capture& from = dataset.captures[capture];
  return {from.name,
          CameraMountFromTargetMount(dataset.setup, from.base_from_gripper),
          std::move(observations),
          from.role,
          capture,
          from.effect,
          from.gripper_by_joints,
          from.joints};
}

Rigid3d PredictedPose(const Dataset& dataset, const Solution& solution, size_t capture) {
  const View view = ViewOf(dataset, capture, {});
  return CameraFromTarget(solution.hand_eye, CorrectedMount(dataset.setup, view, solution));
}

PredictedImages PredictCaptures(const Dataset& dataset, const Solution& solution, double rms_px) {
  PredictedImages predicted{{solution.camera}, {solution.shape}, {}, {rms_px}};
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    predicted.camera_from_target.push_back(PredictedPose(dataset, solution, i));
  }
  return predicted;
}

std::vector<View> ViewsOf(const Dataset& dataset, const std::vector<CaptureDetection>& detections) {
  std::vector<View> views;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    if (detections[i].detection.ids.empty()) continue;
    views.push_back(ViewOf(dataset, i, ObservationsOf(*dataset.target, detections[i].detection)));
  }
  return views;
}

CalibrationOptions OptionsOf(const Dataset& dataset, const RunOptions& run, int width_px, int height_px) {
  CalibrationOptions options;
  options.methods = run.methods;
  options.seed = run.seed;
  options.bundle = run.bundle;
  options.bundle.known_target_scale_sigma = dataset.target->scale_sigma().value_or(kTargetScaleSigma);
  options.choose = run.choose;
  options.choose_camera_model = run.choose_camera_model;
  options.setup = dataset.setup;
  options.camera = dataset.camera;
  options.camera_model = run.camera_model;
  options.bundle.num_threads = run.num_threads;
  options.width_px = width_px;
  options.height_px = height_px;
  options.symmetries = dataset.target->Symmetries();
  options.shape = DesignedShape(AllPoints(*dataset.target).points_in_target);
  options.has_smooth_remainder = run.smooth != SmoothPoseErrors::kNone;
  return options;
}

}  // namespace heba
