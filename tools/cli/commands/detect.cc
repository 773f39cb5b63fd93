#include <algorithm>
#include <filesystem>
#include <iostream>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/parallel.h"
#include "heba/evaluation/metrics.h"
#include "heba/geometry/homography.h"
#include "heba/image_detection.h"
#include "solvers/calibration/camera_choice.h"
#include "solvers/initial/intrinsics.h"
#include "solvers/initial/target_pose.h"
#include "targets/images/image.h"
#include "targets/render/overlay.h"
#include "tools/cli/command.h"
#include "tools/cli/detect_any.h"
#include "tools/cli/flags.h"
#include "tools/config/run_config.h"
#include "tools/files/cached_detector.h"
#include "tools/files/detection_file.h"
#include "tools/files/detection_summary.h"
#include "tools/files/result_folder.h"
#include "tools/text/console.h"
#include "tools/text/run_console.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

// An image, and what was detected of each target in it.
struct SearchedImage {
  std::string name;
  fs::path file;
  std::vector<CaptureDetection> of_targets;
};

// The images of one camera.
struct SearchedCamera {
  std::string name;             // Empty for the only camera.
  std::optional<Camera> given;  // For images of this size.
  std::string model;            // Of the camera that is estimated if none is given; empty: it is to be chosen.
  std::vector<SearchedImage> images;
};

using TargetList = std::vector<std::shared_ptr<const Target>>;

// Returns the camera that is given, or one that is estimated from these images; nothing if there are too few of them.
std::optional<Camera> FittedCamera(const SearchedCamera& camera, const TargetList& targets) {
  if (camera.given) return camera.given;
  std::vector<View> views;
  for (const SearchedImage& image : camera.images) {
    for (size_t t = 0; t < targets.size(); ++t) {
      if (image.of_targets[t].detection.ids.empty()) continue;
      View& view = views.emplace_back();
      view.observations = ObservationsOf(*targets[t], image.of_targets[t].detection);
    }
  }
  if (views.empty()) return std::nullopt;
  const int width_px = camera.images.front().of_targets.front().width_px;
  const int height_px = camera.images.front().of_targets.front().height_px;
  if (camera.model.empty()) {
    const Outcome<CameraChoice> choice = ChooseCameraModel(views, width_px, height_px);
    return choice ? std::optional(choice->camera) : std::nullopt;
  }
  const Outcome<Camera> estimated = EstimateIntrinsics(views, camera.model, width_px, height_px);
  return estimated ? std::optional(*estimated) : std::nullopt;
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

// Draws the points of each target into the images of a camera, in a new folder, and returns their summary.
CameraDetections DrawDetections(const SearchedCamera& camera, const TargetList& targets,
                                const std::vector<SearchedTarget>& names, const fs::path& folder) {
  const std::optional<Camera> fitted = FittedCamera(camera, targets);
  CameraDetections summary;
  summary.camera = camera.name;
  if (fitted) {
    summary.fit = camera.given ? CameraDetections::Fit::kGivenCamera : CameraDetections::Fit::kEstimatedCamera;
    summary.camera_model = fitted->model;
  }
  fs::create_directories(folder);
  summary.images.resize(camera.images.size());
  ParallelFor(static_cast<int>(camera.images.size()), NumThreads(), [&](int index) {
    const SearchedImage& image = camera.images[static_cast<size_t>(index)];
    ImageDetections& of_image = summary.images[static_cast<size_t>(index)];
    of_image.image = image.name;
    std::vector<OverlayPoints> drawn;
    for (size_t t = 0; t < targets.size(); ++t) {
      const Detection& detection = image.of_targets[t].detection;
      OverlayPoints points;
      points.observations = ObservationsOf(*targets[t], detection);
      points.residuals = FitResiduals(fitted, points.observations);
      TargetDetections of_target;
      of_target.num_points = static_cast<size_t>(points.observations.size());
      of_target.reason = detection.reason;
      if (points.residuals) {
        of_target.rms_px = SquaredErrors{points.residuals->squaredNorm(), points.observations.size()}.RmsPx();
        // The RMS length of the arrows is at most 30 px: the distortion, which a homography does not explain, would
        // otherwise cover the image.
        points.magnification = std::min(points.magnification, 30.0 / std::max(*of_target.rms_px, 1e-9));
      }
      points.caption = (t == 0 ? image.name + ": " : "") + DetectionLine(names[t], of_target);
      drawn.push_back(std::move(points));
      of_image.targets.push_back(std::move(of_target));
    }
    WriteImage(folder / (image.name.ends_with(".png") ? image.name : image.name + ".png"),
               DrawOverlay(ReadGreyImage(image.file), drawn));
  });
  return summary;
}

// The images of all cameras that a config names.
struct SearchedImages {
  TargetList targets;
  std::vector<SearchedTarget> target_names;
  std::vector<SearchedCamera> cameras;
};

// Detects all targets in the images of all cameras, and writes the detections into the folder.
SearchedImages Search(const RunConfig& config, const fs::path& folder, RunObserver* observer) {
  const Dataset& data = config.data;
  CheckCamerasByHeader(data);
  const std::vector<TargetDetection> detections =
      DetectDataset(data, CachedDetections(data, config.targets_used), NumThreads(), observer);
  const Problem rig = WithImageSizes(data, detections);
  WriteDetections(data, detections, folder);
  SearchedImages searched{data.targets, {}, {}};
  for (size_t t = 0; t < data.targets.size(); ++t) {
    searched.target_names.push_back({rig.targets[t].name, data.targets[t]->points().size()});
  }
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    SearchedCamera& camera = searched.cameras.emplace_back();
    camera.name = rig.cameras[c].name;
    camera.model = rig.cameras[c].camera.model;
    if (data.has_camera[c]) camera.given = rig.cameras[c].camera;
  }
  for (const TargetDetection& detection : detections) {
    SearchedCamera& camera = searched.cameras[detection.camera];
    // The detections of the targets in one image follow one another.
    if (detection.target == 0) {
      const fs::path& image = data.captures[detection.capture].images[detection.camera];
      camera.images.push_back({image.filename().string(), image, {}});
    }
    camera.images.back().of_targets.push_back(detection.detection);
  }
  return searched;
}

// Detects, draws, and writes the folder of the results. Returns the exit status.
int DetectByConfig(const std::string& path, const RunConfig& config) {
  const std::string& name = config.data.name;
  const fs::path output =
      FLAGS_out.empty() ? fs::absolute(path).parent_path() / "detections" / name : fs::path(FLAGS_out);
  StagedFolder folder(output, "detections");
  ProgressObserver observer(FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  const SearchedImages searched = Search(config, folder.staging(), &observer);
  DetectionSummary summary{name, searched.target_names, {}, output};
  for (const SearchedCamera& camera : searched.cameras) {
    summary.cameras.push_back(
        DrawDetections(camera, searched.targets, searched.target_names, folder.staging() / "overlays" / camera.name));
  }
  folder.Commit();
  if (FLAGS_json) {
    std::cout << DetectionSummaryToJson(summary) << std::flush;
  } else if (!FLAGS_quiet) {
    std::cout << ForTerminal(DetectionText(summary)) << "images: " << (output / "overlays").string() << std::endl;
  }
  if (summary.NumSeen() > 0) return kDone;
  PrintError(path + (searched.targets.size() > 1 ? ": no target was" : ": the target was not") +
             " detected in any image");
  return kWorkFailed;
}

}  // namespace

int RunCommand_detect(const std::vector<std::string>& arguments) {
  if (FLAGS_any) return DetectAny(arguments);
  if (arguments.size() > 1) throw InputError("'heba detect' takes one CONFIG, or images with --any");
  const std::string& path = arguments[0];
  const RunConfig config = ReadRunConfig(path, Settings());
  if (!config.data.given_detections.empty()) {
    throw InputError(path + ": has points that were detected before (captures.detections), and no images to search");
  }
  if (!config.data.target_poses.empty()) {
    throw InputError(path + ": has poses of the target (captures.target_poses), and no images to search");
  }
  return DetectByConfig(path, config);
}

}  // namespace heba
