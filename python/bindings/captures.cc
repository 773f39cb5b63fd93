#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/detection.h"
#include "heba/io/result_file.h"
#include "heba/run.h"
#include "python/bindings/arrays.h"
#include "python/bindings/bindings.h"
#include "python/bindings/python_observer.h"
#include "tools/text/arm_keys.h"
#include "tools/text/finding_text.h"

namespace heba {
namespace {

// The ids, the pixels (n x 2) and the positions on the target (n x 3) of the points that an image shows.
pybind11::tuple Detected(const Target& target, const Detection& detection) {
  const Observations observations = ObservationsOf(target, detection);
  pybind11::array_t<int> ids(static_cast<pybind11::ssize_t>(observations.ids.size()));
  std::copy(observations.ids.begin(), observations.ids.end(), ids.mutable_data());
  return pybind11::make_tuple(ids, ArrayOf(observations.pixels.transpose()),
                              ArrayOf(observations.points_in_target.transpose()), detection.reason);
}

pybind11::tuple DetectArray(const GreyArray& grey, const std::string& target_yaml) {
  std::unique_ptr<Target> target;
  const cv::Mat image = MatOf(grey);
  Detection detection;
  {
    const pybind11::gil_scoped_release release;
    target = ParseTarget(target_yaml);
    detection = target->Detect(image);
  }
  return Detected(*target, detection);
}

pybind11::tuple DetectFile(const std::filesystem::path& image, const std::string& target_yaml) {
  std::unique_ptr<Target> target;
  CaptureDetection seen;
  {
    const pybind11::gil_scoped_release release;
    target = ParseTarget(target_yaml);
    seen = DetectCapture(*target, image);
  }
  return Detected(*target, seen.detection);
}

// The detections of one capture: ids (n) and pixels (n x 2).
using CapturePoints = std::pair<std::vector<int>, DoubleArray>;

// One camera: its name, the points of each capture, of which the camera may have no image, the width and height of its
// images, and the name of its model with its parameters, if they are given.
using CameraPoints = std::tuple<std::string, std::vector<std::optional<CapturePoints>>, std::pair<int, int>,
                                std::optional<std::pair<std::string, std::vector<double>>>>;

CaptureDetection DetectionOf(const CapturePoints& points, const std::pair<int, int>& size) {
  CaptureDetection detection;
  std::tie(detection.width_px, detection.height_px) = size;
  detection.detection.ids = points.first;
  const auto pixels = points.second.unchecked<2>();
  for (pybind11::ssize_t k = 0; k < pixels.shape(0); ++k) {
    detection.detection.pixels.emplace_back(pixels(k, 0), pixels(k, 1));
  }
  return detection;
}

// Returns the cameras, which one arm moves against the target, and their points. The target is not set. A camera
// without a name is that of a config in the short form.
Dataset DatasetOf(Setup setup, const std::vector<CameraPoints>& cameras, const std::vector<Rigid3d>& poses) {
  Dataset data = DatasetOf(setup, nullptr);
  data.name = "arrays";
  const ProblemCamera unnamed = data.rig.cameras[0];
  if (!std::get<0>(cameras.front()).empty()) {
    data.rig.robots = {kOnlyArm};
    data.rig.targets[0].name = "target";
  }
  data.rig.cameras.clear();
  data.has_camera.clear();
  data.camera_sources.clear();
  for (size_t i = 0; i < poses.size(); ++i) {
    data.captures.push_back({std::to_string(i), {poses[i]}, std::vector<std::filesystem::path>(cameras.size())});
  }
  for (size_t c = 0; c < cameras.size(); ++c) {
    const auto& [name, captures, size, given] = cameras[c];
    ProblemCamera& camera = data.rig.cameras.emplace_back(unnamed);
    camera.name = name;
    camera.camera = {given ? given->first : "", size.first, size.second, given ? given->second : std::vector<double>()};
    const std::string faults = given ? CheckCamera(camera.camera) : "";
    const std::string source = name.empty() ? "camera" : "camera " + name;
    if (!faults.empty()) throw InputError(source + ": " + faults);
    data.has_camera.push_back(given.has_value());
    data.camera_sources.push_back(source);
    for (size_t i = 0; i < captures.size(); ++i) {
      if (!captures[i]) continue;
      data.captures[i].images[c] = data.captures[i].name;
      data.given_detections.push_back({i, c, 0, DetectionOf(*captures[i], size)});
    }
  }
  return data;
}

// Returns the text of result.json, with the findings in words. Throws InputError if the calibration failed.
std::string ResultText(Outcome<RunOutput> output) {
  if (!output) throw InputError(FailureText(output.failure(), ConfigKeys::kOmitted));
  return ResultToJson(Described(std::move(output->result), ConfigKeys::kOmitted));
}

// Calibrates from detected points and returns the text of result.json.
std::string CalibratePoints(const std::string& setup, const std::string& target_yaml,
                            const std::vector<CameraPoints>& cameras, const DoubleArray& base_from_grippers,
                            int num_folds, int num_threads, const pybind11::object& progress,
                            const Cancellation& cancellation) {
  Dataset data = DatasetOf(*FindSetup(setup), cameras, PosesFrom(base_from_grippers));
  PythonObserver observer(progress, cancellation);
  std::string text;
  std::optional<std::string> fault;
  {
    const pybind11::gil_scoped_release release;
    data.targets = {ParseTarget(target_yaml)};
    RunOptions options;
    options.folds = num_folds;
    options.num_threads = num_threads;
    try {
      text = ResultText(Run(data, options, &observer));
    } catch (const InputError& error) {
      fault = error.what();
    }
  }
  observer.RethrowIfRaised();
  if (fault) throw InputError(*fault);
  return text;
}

}  // namespace

void BindCaptures(pybind11::module_& module) {
  using pybind11::arg;
  module.def("target_ids", [](const std::string& target_yaml) {
    const pybind11::gil_scoped_release release;
    const std::unique_ptr<Target> target = ParseTarget(target_yaml);
    std::vector<int> ids;
    for (const TargetPoint& point : target->points()) ids.push_back(point.id);
    return ids;
  });
  module.def("detect_array", &DetectArray, arg("grey"), arg("target"));
  module.def("detect_file", &DetectFile, arg("image"), arg("target"));
  module.def("calibrate", &CalibratePoints, arg("setup"), arg("target"), arg("cameras"), arg("base_from_gripper"),
             arg("num_folds"), arg("num_threads"), arg("progress"), arg("cancellation"));
}

}  // namespace heba
