#include "tools/run/captures.h"

#include <algorithm>
#include <utility>

#include "heba/data/hand_eye.h"
#include "heba/image_detection.h"

namespace heba {
namespace {

bool StatesSize(const CaptureDetection& detection) { return detection.width_px > 0 && detection.height_px > 0; }

}  // namespace

bool IsImageSizeKnown(const PairDataset& dataset) {
  return (dataset.camera && dataset.camera->width_px > 0) ||
         std::all_of(dataset.given_detections.begin(), dataset.given_detections.end(), StatesSize);
}

Dataset AsDataset(const PairDataset& dataset) {
  Dataset whole;
  whole.name = dataset.name;
  whole.rig = HandEyeProblem(dataset.setup, dataset.camera.value_or(Camera()), TargetShape());
  whole.has_camera = {dataset.camera.has_value()};
  whole.camera_sources = {dataset.camera_source};
  whole.targets = {dataset.target};
  for (const Capture& capture : dataset.captures) {
    whole.captures.push_back({capture.name, {capture.base_from_gripper}, {capture.image}, {capture.joints}});
  }
  whole.given_detections = AsTargetDetections(dataset.given_detections);
  whole.detections_source = dataset.detections_source;
  whole.arms = {dataset.robot};
  whole.robot_scale_sigmas = {dataset.robot_scale_sigma};
  if (dataset.truth) {
    const Truth& truth = *dataset.truth;
    whole.truth = CellTruth{{truth.camera_mount_from_camera},
                            {truth.target_mount_from_target},
                            {Rigid3d()},
                            {truth.camera},
                            {truth.arm_errors}};
  }
  return whole;
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

std::vector<TargetDetection> AsTargetDetections(const std::vector<CaptureDetection>& detections) {
  std::vector<TargetDetection> all;
  for (size_t i = 0; i < detections.size(); ++i) all.push_back({i, 0, 0, detections[i]});
  return all;
}

std::vector<CaptureDetection> AsCaptureDetections(std::vector<TargetDetection> detections) {
  std::vector<CaptureDetection> all;
  for (TargetDetection& detection : detections) all.push_back(std::move(detection.detection));
  return all;
}

std::vector<CaptureDetection> DetectCaptures(const PairDataset& dataset, const DetectFunction& detect, int num_threads,
                                             RunObserver* observer) {
  return AsCaptureDetections(DetectDataset(AsDataset(dataset), {detect}, num_threads, observer));
}

void FitCameraToImages(const std::vector<CaptureDetection>& detections, PairDataset* dataset) {
  if (!dataset->camera) return;
  const Dataset whole = AsDataset(*dataset);
  Problem rig = whole.rig;
  FitCamerasToImages(whole, AsTargetDetections({detections.front()}), &rig);
  dataset->camera = rig.cameras[0].camera;
}

ImageResult EntryOfUnused(const Capture& capture) {
  ImageResult image;
  image.capture = capture.name;
  image.image = capture.name;
  image.role = capture.role;
  return image;
}

View ViewOf(const PairDataset& dataset, size_t capture, Observations observations) {
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

Rigid3d PredictedPose(const PairDataset& dataset, const PairSolution& solution, size_t capture) {
  const View view = ViewOf(dataset, capture, {});
  return CameraFromTarget(solution.hand_eye, CorrectedMount(dataset.setup, view, solution));
}

PredictedImages PredictCaptures(const PairDataset& dataset, const PairSolution& solution, double rms_px) {
  PredictedImages predicted{{solution.camera}, {solution.shape}, {}, {rms_px}};
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    predicted.camera_from_target.push_back(PredictedPose(dataset, solution, i));
  }
  return predicted;
}

std::vector<View> ViewsOf(const PairDataset& dataset, const std::vector<CaptureDetection>& detections) {
  std::vector<View> views;
  for (size_t i = 0; i < dataset.captures.size(); ++i) {
    if (detections[i].detection.ids.empty()) continue;
    views.push_back(ViewOf(dataset, i, ObservationsOf(*dataset.target, detections[i].detection)));
  }
  return views;
}

PairCalibrationOptions OptionsOf(const PairDataset& dataset, const PairRunOptions& run, int width_px, int height_px) {
  PairCalibrationOptions options;
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
  if (run.earlier) {
    // The captures are read in the orders of the earlier run.
    if (!run.earlier->change.is_target_moved) options.symmetries = {Rigid3d()};
    options.shape.params = run.earlier->result->solution.shapes[0].params;
  }
  options.has_smooth_remainder = run.smooth != SmoothPoseErrors::kNone;
  return options;
}

}  // namespace heba
