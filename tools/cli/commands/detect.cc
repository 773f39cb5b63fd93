#include <algorithm>
#include <filesystem>
#include <iostream>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/parallel.h"
#include "heba/evaluation/metrics.h"
#include "heba/geometry/homography.h"
#include "solvers/calibration/camera_choice.h"
#include "solvers/initial/intrinsics.h"
#include "solvers/initial/target_pose.h"
#include "targets/images/image.h"
#include "targets/render/overlay.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/run_config.h"
#include "tools/files/cached_detector.h"
#include "tools/files/detection_file.h"
#include "tools/files/detection_summary.h"
#include "tools/files/result_folder.h"
#include "tools/run/captures.h"
#include "tools/text/console.h"
#include "tools/text/run_console.h"

namespace heba {
namespace {

// Returns the camera of the config, or one that is estimated from these images; nothing if there are too few of them.
std::optional<Camera> FittedCamera(const RunConfig& config, const std::vector<CaptureDetection>& detections) {
  if (config.data.camera) return config.data.camera;
  const std::vector<View> views = ViewsOf(config.data, detections);
  if (views.empty()) return std::nullopt;
  const int width_px = detections.front().width_px;
  const int height_px = detections.front().height_px;
  if (config.options.choose_camera_model) {
    const Outcome<CameraChoice> choice = ChooseCameraModel(views, width_px, height_px);
    return choice ? std::optional(choice->camera) : std::nullopt;
  }
  const Outcome<Camera> camera = EstimateIntrinsics(views, config.options.camera_model, width_px, height_px);
  return camera ? std::optional(*camera) : std::nullopt;
}

// Returns the distances of the points from the best-fitting target: under the camera if there is one, otherwise under
// a homography of the plane, which does not model lens distortion.
std::optional<Points2> FitResiduals(const std::optional<Camera>& camera, const Observations& observations) {
  if (observations.size() < 4) return std::nullopt;
  if (camera) {
    const std::vector<TargetPose> poses = EstimateTargetPose(*camera, observations);
    if (poses.empty()) return std::nullopt;
    return Residuals(*camera, poses.front().camera_from_target, observations);
  }
  const Points2 on_target = observations.points_in_target.topRows<2>();
  const std::optional<Eigen::Matrix3d> homography = LinearHomography(on_target, observations.pixels);
  if (!homography) return std::nullopt;
  Points2 residuals(2, observations.size());
  for (Eigen::Index i = 0; i < residuals.cols(); ++i) {
    const Eigen::Vector3d image = *homography * on_target.col(i).homogeneous();
    residuals.col(i) = image.hnormalized() - observations.pixels.col(i);
  }
  return residuals;
}

}  // namespace

int RunCommand_detect(const std::vector<std::string>& arguments) {
  namespace fs = std::filesystem;
  RunConfig config = ReadRunConfig(arguments[0], Settings());
  for (const Capture& capture : config.data.captures) {
    if (capture.image.empty()) throw InputError(arguments[0] + ": capture " + capture.name + " has no image");
  }
  const Verbosity verbosity = FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal;
  const fs::path output = FLAGS_out.empty() ? fs::absolute(arguments[0]).parent_path() / "detections" / config.data.name
                                            : fs::path(FLAGS_out);
  StagedFolder folder(output, "detections");
  CheckCameraByHeader(config.data);
  ProgressObserver observer(verbosity);
  const std::vector<CaptureDetection> detections =
      DetectCaptures(config.data, CachedDetection(config.data, config.target_used), NumThreads(), &observer);
  FitCameraToImages(detections.front(), &config.data);
  const std::optional<Camera> camera = FittedCamera(config, detections);
  DetectionSummary summary;
  summary.name = config.data.name;
  summary.num_target_points = config.data.target->points().size();
  summary.folder = output;
  if (camera) {
    summary.fit = config.data.camera ? DetectionSummary::Fit::kGivenCamera : DetectionSummary::Fit::kEstimatedCamera;
    summary.camera_model = camera->model;
  }
  fs::create_directory(folder.staging() / "overlays");
  summary.images.resize(config.data.captures.size());
  ParallelFor(static_cast<int>(config.data.captures.size()), NumThreads(), [&](int index) {
    const size_t i = static_cast<size_t>(index);
    const Observations observations = ObservationsOf(*config.data.target, detections[i].detection);
    const std::optional<Points2> residuals = FitResiduals(camera, observations);
    ImageDetections& image = summary.images[i];
    image.image = config.data.captures[i].name;
    image.num_points = static_cast<size_t>(observations.size());
    image.reason = detections[i].detection.reason;
    if (residuals) image.rms_px = SquaredErrors{residuals->squaredNorm(), observations.size()}.RmsPx();
    OverlayOptions options;
    options.caption = DetectionLine(summary, image);
    if (residuals) {
      // The RMS length of the arrows is at most 30 px: the distortion, which a homography does not explain, would
      // otherwise cover the image.
      options.magnification = std::min(options.magnification, 30.0 / std::max(*image.rms_px, 1e-9));
    }
    const cv::Mat overlay = DrawOverlay(ReadGreyImage(config.data.captures[i].image), observations, residuals, options);
    WriteImage(folder.staging() / "overlays" / (config.data.captures[i].name + ".png"), overlay);
  });
  WriteFileAtomically(folder.staging() / "detections.json", DetectionsToJson(config.data.captures, detections));
  folder.Commit();
  if (FLAGS_json) {
    std::cout << DetectionSummaryToJson(summary) << std::flush;
  } else if (!FLAGS_quiet) {
    std::cout << ForTerminal(DetectionText(summary)) << "images: " << (output / "overlays").string() << std::endl;
  }
  if (summary.NumSeen() > 0) return kDone;
  PrintError(arguments[0] + ": the target was not detected in any image");
  return kWorkFailed;
}

}  // namespace heba
