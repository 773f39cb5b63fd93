#include <filesystem>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "heba/base/error.h"
#include "heba/base/text.h"
#include "heba/io/result_file.h"
#include "python/bindings/arrays.h"
#include "python/bindings/bindings.h"
#include "python/bindings/names.h"
#include "tools/config/finished_run.h"
#include "tools/config/run_folder.h"
#include "tools/run/image_location.h"
#include "tools/text/failure_text.h"
#include "tools/text/location_text.h"

namespace heba {
namespace {

// The image of a camera: its name, which is empty for a single one, and an array or a file.
using CameraImage = std::tuple<std::string, std::optional<GreyArray>, std::filesystem::path>;
// The pose of an arm, 1 x 4 x 4, with the arm's name; the name is empty for the only arm.
using ArmPoseGiven = std::pair<std::string, DoubleArray>;

// The positions of the joints of an arm (rad or m), with the arm's name as in ArmPoseGiven.
using ArmJoints = std::pair<std::string, std::vector<double>>;

// Returns what is given for each arm.
std::vector<GivenArmPose> PosesOf(const std::vector<std::pair<std::string, Rigid3d>>& poses,
                                  const std::vector<ArmJoints>& joints, const std::vector<std::string>& robots) {
  std::vector<GivenArmPose> given(robots.size());
  for (const auto& [name, pose] : poses) given[IndexOfArm("pose", name, robots)].base_from_gripper = pose;
  for (const auto& [name, positions] : joints) {
    given[IndexOfArm("joints", name, robots)].joints =
        Eigen::Map<const Eigen::VectorXd>(positions.data(), static_cast<Eigen::Index>(positions.size()));
  }
  return given;
}

// Returns the poses of the arms for images of these cameras. Throws InputError if one cannot be corrected by the
// estimated errors of the arm.
std::vector<ArmPose> CorrectedPoses(const RunResult& result, const std::vector<size_t>& cameras,
                                    const std::vector<GivenArmPose>& given) {
  std::vector<ArmPose> arms = PosesForCameras(result, cameras, given, "pose", "joints");
  for (size_t r = 0; r < arms.size(); ++r) {
    if (arms[r].why_not_corrected.empty()) continue;
    const std::string& robot = result.rig.robots[r];
    throw InputError("pose: " + (robot.empty() ? "" : "arm " + robot + ": ") + arms[r].why_not_corrected +
                     "; joints, those of the arm, would tell them");
  }
  return arms;
}

// Returns the detection of a target in the image of a camera, whose size must be that of the calibration.
Detection DetectIn(const Target& target, const Camera& camera, const std::string& name, const cv::Mat& image,
                   const std::filesystem::path& file) {
  if (image.empty()) return DetectFor(camera, target, file);
  CheckImageSize(camera, {image.cols, image.rows}, name.empty() ? "image" : "image of camera " + name);
  return target.Detect(image);
}

// A location holds what images show in the frames of a run's result, beside the request that it answers.
struct LocatedImages {
  LocationRequest request;
  ImageLocation location;
};

LocatedImages LocateWith(const FinishedRun& run, const std::vector<CameraImage>& images,
                         const std::vector<cv::Mat>& pixels, const std::vector<std::pair<std::string, Rigid3d>>& poses,
                         const std::vector<ArmJoints>& joints) {
  const Problem& problem = run.result.rig;
  std::vector<std::string> names;
  for (const ProblemCamera& camera : problem.cameras) names.push_back(camera.name);
  std::vector<size_t> cameras;
  for (const CameraImage& image : images) cameras.push_back(IndexOf("image", std::get<0>(image), names));
  LocationRequest request;
  request.result = &run.result;
  request.targets = run.targets;
  request.arms = CorrectedPoses(run.result, cameras, PosesOf(poses, joints, problem.robots));
  std::vector<Sighting> sightings;
  for (size_t i = 0; i < images.size(); ++i) {
    const Camera& camera = run.result.solution.cameras[cameras[i]];
    for (size_t t = 0; t < run.targets.size(); ++t) {
      sightings.push_back(
          {cameras[i], t, DetectIn(*run.targets[t], camera, names[cameras[i]], pixels[i], std::get<2>(images[i]))});
    }
  }
  ImageLocation location = LocateInImages(request, "", sightings);
  return {std::move(request), std::move(location)};
}

// Returns, for each pose of each target that fits the images, the target's name, the cameras that see it,
// world_from_target, the covariance (6 x 6, in the target's frame), the RMS in px, the number of poses that fit,
// LocatedTarget::p_value, and the covariance of the target's centre (m^2, along the world's axes). Throws InputError if
// the images of a target contradict each other, or if no target is located.
std::vector<pybind11::tuple> Locate(const std::filesystem::path& folder, const std::vector<CameraImage>& images,
                                    const std::vector<ArmPoseGiven>& base_from_grippers,
                                    const std::vector<ArmJoints>& joints) {
  std::vector<std::pair<std::string, Rigid3d>> given;
  for (const auto& [name, pose] : base_from_grippers) given.emplace_back(name, PosesFrom(pose).front());
  std::vector<cv::Mat> pixels;
  for (const CameraImage& image : images) {
    const std::optional<GreyArray>& grey = std::get<1>(image);
    pixels.push_back(grey ? MatOf(*grey) : cv::Mat());
  }
  FinishedRun run;
  LocatedImages found;
  {
    const pybind11::gil_scoped_release release;
    run = ReadFinishedRun(folder);
    found = LocateWith(run, images, pixels, given, joints);
  }
  const auto& [request, location] = found;
  if (!location.fault.empty()) throw InputError(FailureText(location.fault));
  std::vector<pybind11::tuple> all;
  std::vector<std::string> faults;
  for (const TargetLocation& target : location.targets) {
    if (target.contradiction) throw InputError(TargetFault(request, target));
    if (target.possible.empty()) faults.push_back(TargetFault(request, target));
    std::vector<std::string> by;
    for (const size_t camera : target.cameras) by.push_back(run.result.rig.cameras[camera].name);
    for (const PossiblePose& possible : target.possible) {
      const LocatedTarget& located = possible.located;
      all.push_back(pybind11::make_tuple(run.result.rig.targets[target.target].name, by,
                                         ArrayOf(located.world_from_target), ArrayOf(located.pose_covariance.Total()),
                                         located.rms_px, target.possible.size(), located.p_value,
                                         ArrayOf(located.covariance.TotalM2())));
    }
  }
  if (all.empty()) throw InputError(Join(faults, "; "));
  return all;
}

}  // namespace

void BindLocations(pybind11::module_& module) {
  using pybind11::arg;
  module.def(
      "has_names",
      [](const std::filesystem::path& folder) {
        const pybind11::gil_scoped_release release;
        return !IsShortFile(RunFolderOf(folder) / "result.json");
      },
      arg("folder"));
  module.def("locate", &Locate, arg("folder"), arg("images"), arg("base_from_gripper"), arg("joints"));
}

}  // namespace heba
