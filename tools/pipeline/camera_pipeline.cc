#include "tools/pipeline/camera_pipeline.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/failure_code.h"
#include "heba/base/files.h"
#include "heba/image_detection.h"
#include "heba/run.h"
#include "tools/files/cached_detector.h"
#include "tools/files/camera_result.h"
#include "tools/files/detection_file.h"
#include "tools/files/result_folder.h"
#include "tools/pages/camera_page.h"
#include "tools/run/captures.h"
#include "tools/text/run_console.h"

namespace heba {
namespace {

constexpr int kMapColumns = 9;
constexpr int kMapRows = 7;

// Returns the images as the captures of a data set, whose robot stands still.
Dataset DatasetOf(const CameraConfig& config) {
  Dataset data = DatasetOf(Setup::kEyeToHand, config.target);
  data.name = config.name;
  for (const std::filesystem::path& image : config.images) {
    data.captures.push_back({image.filename().string(), {Rigid3d()}, {image}});
  }
  return data;
}

CameraMap MapOf(const CameraCalibration& calibration, const std::vector<View>& views) {
  CameraMap map{kMapColumns, kMapRows, ProjectionSigmasPx(calibration, kMapColumns, kMapRows),
                std::vector<int>(static_cast<size_t>(kMapColumns) * kMapRows, 0)};
  const auto place = [](double pixel, int size_px, int number) {
    return std::clamp(static_cast<int>((pixel + 0.5) * number / size_px), 0, number - 1);
  };
  for (const View& view : views) {
    for (Eigen::Index i = 0; i < view.observations.pixels.cols(); ++i) {
      const int column = place(view.observations.pixels(0, i), calibration.camera.width_px, kMapColumns);
      const int row = place(view.observations.pixels(1, i), calibration.camera.height_px, kMapRows);
      ++map.num_points[static_cast<size_t>(row) * kMapColumns + static_cast<size_t>(column)];
    }
  }
  return map;
}

}  // namespace

Outcome<CalibratedCamera> RunCamera(const CameraConfig& config, const std::filesystem::path& output, int num_threads,
                                    Console* console) {
  StagedFolder folder(output, "the results of a run");
  const Dataset data = DatasetOf(config);
  ProgressObserver observer(console->verbosity());
  const std::vector<TargetDetection> detections =
      DetectDataset(data, {CachedDetection(config.target_used)}, num_threads, &observer);
  std::vector<UnusedImage> unused;
  std::vector<View> views = ViewsOf(data, detections);
  std::map<std::string, std::string> name_of_digest;
  for (const TargetDetection& seen : detections) {
    const std::string& name = data.captures[seen.capture].name;
    const Detection& detection = seen.detection.detection;
    // A copy of an image says nothing new.
    const auto [first, is_new] = name_of_digest.emplace(seen.detection.image_digest, name);
    if (!is_new && !first->first.empty()) {
      unused.push_back({name, "is a copy of " + first->second});
      std::erase_if(views, [&](const View& view) { return view.capture == seen.capture; });
    } else if (detection.ids.empty()) {
      unused.push_back({name, detection.reason});
    } else {
      continue;
    }
    console->Note(data.name + ": " + name + ": " + unused.back().reason);
  }
  const CaptureDetection& first = detections.front().detection;
  if (views.empty()) {
    return Failure{FailureCode("nothing_detected"),
                   {{"images", static_cast<double>(detections.size())}},
                   {{"image", data.captures[0].name}, {"why", first.detection.reason}}};
  }
  CameraCalibrationOptions options = config.options;
  options.width_px = first.width_px;
  options.height_px = first.height_px;
  options.shape = DesignedShape(AllPoints(*config.target).points_in_target);
  options.num_threads = num_threads;
  Outcome<CameraCalibration> calibration = CalibrateCamera(views, options);
  if (!calibration) return calibration.failure();
  CalibratedCamera result{std::move(*calibration), {}};
  result.map = MapOf(result.calibration, views);
  const std::filesystem::path& staging = folder.staging();
  for (const auto& [name, text] : CameraFiles(config.name, result.calibration)) {
    WriteFileAtomically(staging / name, text);
  }
  WriteDetections(data, detections, staging);
  WriteFileAtomically(staging / "config.yaml", config.used);
  WriteFileAtomically(staging / "log.txt", console->log());
  WriteFileAtomically(staging / "report.html", CameraPage(config.name, result.calibration, result.map, unused));
  WriteFileAtomically(staging / "result.json",
                      CameraResultToJson(config.name, config.about, result.calibration, result.map, unused));
  folder.Commit();
  return result;
}

}  // namespace heba
