#include "tools/run/captures.h"

#include <algorithm>
#include <mutex>

#include "heba/base/error.h"
#include "heba/base/parallel.h"
#include "heba/base/text.h"
#include "targets/images/image.h"

namespace heba {
namespace {

bool StatesSize(const CaptureDetection& detection) { return detection.width_px > 0 && detection.height_px > 0; }

// Throws InputError unless all detections have the same image size.
void CheckSizes(const Dataset& dataset, const std::vector<CaptureDetection>& detections) {
  const int width_px = detections.front().width_px;
  const int height_px = detections.front().height_px;
  for (size_t i = 1; i < detections.size(); ++i) {
    if (detections[i].width_px != width_px || detections[i].height_px != height_px) {
      throw InputError(dataset.captures[i].name + ": is " +
                       ImageSizeText(detections[i].width_px, detections[i].height_px) + ", but " +
                       dataset.captures[0].name + " is " + ImageSizeText(width_px, height_px) +
                       "; all images must come from one camera at one resolution");
    }
  }
}

// Returns the given detections with the size of their images or, if that is not stated, of the camera's.
std::vector<CaptureDetection> GivenDetections(const Dataset& dataset) {
  if (!IsImageSizeKnown(dataset)) {
    throw InputError(dataset.detections_source + ": does not state the image size; provide a camera that does");
  }
  std::vector<CaptureDetection> detections = dataset.given_detections;
  for (CaptureDetection& detection : detections) {
    if (StatesSize(detection)) continue;
    detection.width_px = dataset.camera->width_px;
    detection.height_px = dataset.camera->height_px;
  }
  return detections;
}

}  // namespace

StageReport::StageReport(RunStage stage, int num_steps, RunObserver* observer) : stage_(stage), observer_(observer) {
  EndIfCancelled(observer);
  if (observer != nullptr) observer->OnStage(stage, num_steps);
}

StageReport::~StageReport() {
  if (observer_ != nullptr) observer_->OnStageEnd(stage_);
}

void StageReport::Step() {
  if (observer_ != nullptr) observer_->OnStep(stage_);
  EndIfCancelled(observer_);
}

void EndIfCancelled(RunObserver* observer) {
  if (observer != nullptr && observer->IsCancelled()) throw Cancelled();
}

bool IsImageSizeKnown(const Dataset& dataset) {
  return (dataset.camera && dataset.camera->width_px > 0) ||
         std::all_of(dataset.given_detections.begin(), dataset.given_detections.end(), StatesSize);
}

std::vector<CaptureDetection> DetectCaptures(const Dataset& dataset, const DetectFunction& detect, int num_threads,
                                             RunObserver* observer) {
  if (!dataset.given_detections.empty()) {
    std::vector<CaptureDetection> given = GivenDetections(dataset);
    CheckSizes(dataset, given);
    return given;
  }
  // The expected size is read from the header before anything is decoded, because an image of another size may need
  // gigabytes.
  const std::optional<ImageSize> expected = ReadImageSize(dataset.captures.front().image);
  std::vector<CaptureDetection> detections(dataset.captures.size());
  {
    StageReport report(RunStage::kDetection, static_cast<int>(detections.size()), observer);
    std::mutex mutex;
    // Each image is read, searched and released; only a small copy is kept.
    ParallelFor(static_cast<int>(detections.size()), num_threads, [&](int index) {
      const size_t i = static_cast<size_t>(index);
      detections[i] = detect(dataset.captures[i].image, expected);
      const std::lock_guard<std::mutex> lock(mutex);
      report.Step();
    });
  }
  CheckSizes(dataset, detections);
  return detections;
}

void CheckCameraByHeader(const Dataset& dataset) {
  const std::filesystem::path& image = dataset.captures.front().image;
  if (!dataset.camera || image.empty()) return;
  const std::optional<ImageSize> size = ReadImageSize(image);
  if (!size) return;
  Dataset copy = dataset;
  CaptureDetection first;
  first.width_px = size->width_px;
  first.height_px = size->height_px;
  FitCameraToImages(first, &copy);
}

void FitCameraToImages(const CaptureDetection& first, Dataset* dataset) {
  if (!dataset->camera) return;
  Camera& camera = *dataset->camera;
  if (camera.width_px == 0) {
    camera.width_px = first.width_px;
    camera.height_px = first.height_px;
  }
  if (camera.width_px != first.width_px || camera.height_px != first.height_px) {
    throw InputError(dataset->camera_source + ": is for images of " + ImageSizeText(camera.width_px, camera.height_px) +
                     ", but " + dataset->captures[0].name + " is " + ImageSizeText(first.width_px, first.height_px) +
                     "; provide the intrinsics of that resolution");
  }
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
  return options;
}

}  // namespace heba
