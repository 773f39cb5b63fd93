#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "heba/base/error.h"
#include "heba/base/registry.h"
#include "heba/base/text.h"
#include "heba/detection.h"
#include "heba/io/result_file.h"
#include "python/bindings/arrays.h"
#include "python/bindings/bindings.h"
#include "tools/config/finished_rig.h"
#include "tools/config/finished_run.h"
#include "tools/run/rig_image_location.h"
#include "tools/text/rig_location_text.h"

namespace heba {
namespace {

// The image of a camera: its name, and an array or a file.
using CameraImage = std::tuple<std::string, std::optional<GreyArray>, std::filesystem::path>;
// The pose of an arm, 1 x 4 x 4, with the arm's name; the name is empty for the only arm.
using ArmPose = std::pair<std::string, DoubleArray>;

size_t IndexOf(const std::string& what, const std::string& name, const std::vector<std::string>& names) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw InputError(what + ": " + UnknownName(name, names));
  return static_cast<size_t>(found - names.begin());
}

// The positions of the joints of an arm (rad or m), with the arm's name as in ArmPose.
using ArmJoints = std::pair<std::string, std::vector<double>>;

// Returns what is given for each arm.
std::vector<GivenArmPose> PosesOf(const std::vector<std::pair<std::string, Rigid3d>>& poses,
                                  const std::vector<ArmJoints>& joints, const std::vector<std::string>& robots) {
  const auto index_of = [&](const std::string& what, const std::string& name) {
    if (name.empty() && robots.size() > 1) {
      throw InputError(what + ": the rig has several arms; a dictionary by their names is needed: " +
                       Join(robots, ", "));
    }
    return name.empty() ? 0 : IndexOf(what, name, robots);
  };
  std::vector<GivenArmPose> given(robots.size());
  for (const auto& [name, pose] : poses) given[index_of("pose", name)].base_from_gripper = pose;
  for (const auto& [name, positions] : joints) {
    given[index_of("joints", name)].joints =
        Eigen::Map<const Eigen::VectorXd>(positions.data(), static_cast<Eigen::Index>(positions.size()));
  }
  return given;
}

// Returns the stated poses of the arms. Throws InputError if one cannot be corrected by the estimated errors of the
// arm.
std::vector<StatedPose> CorrectedPoses(const RigResult& result, const std::vector<size_t>& cameras,
                                       const std::vector<GivenArmPose>& given) {
  const std::vector<RigArmPose> arms = PosesForCameras(result, cameras, given, "pose", "joints");
  for (size_t r = 0; r < arms.size(); ++r) {
    if (arms[r].why_not_corrected.empty()) continue;
    throw InputError("pose: arm " + result.rig.robots[r] + ": " + arms[r].why_not_corrected +
                     "; joints, those of the arm, would tell them");
  }
  return StatedPosesOf(arms);
}

// Returns the detection of a target in the image of a camera, whose size must be that of the calibration.
Detection DetectIn(const Target& target, const Camera& camera, const std::string& name, const cv::Mat& image,
                   const std::filesystem::path& file) {
  if (image.empty()) return DetectCapture(target, file, ImageSize{camera.width_px, camera.height_px}).detection;
  if (image.cols != camera.width_px || image.rows != camera.height_px) {
    throw InputError("image of camera " + name + ": is " + std::to_string(image.cols) + " x " +
                     std::to_string(image.rows) + " px, but the calibration is for " + std::to_string(camera.width_px) +
                     " x " + std::to_string(camera.height_px) + " px");
  }
  return target.Detect(image);
}

// Returns, for each pose of each target that fits the images, the target's name, the cameras that see it,
// world_from_target, the covariance (6 x 6, in the target's frame), the RMS in px, the number of poses that fit, and
// LocatedTarget::p_value. Throws InputError if the images of a target contradict each other, or if no target is
// located.
std::vector<pybind11::tuple> LocateByRig(const std::filesystem::path& folder, const std::vector<CameraImage>& images,
                                         const std::vector<ArmPose>& base_from_grippers,
                                         const std::vector<ArmJoints>& joints) {
  std::vector<std::pair<std::string, Rigid3d>> given;
  for (const auto& [name, pose] : base_from_grippers) given.emplace_back(name, PosesFrom(pose).front());
  std::vector<cv::Mat> pixels;
  for (const CameraImage& image : images) {
    const std::optional<GreyArray>& grey = std::get<1>(image);
    pixels.push_back(grey ? MatOf(*grey) : cv::Mat());
  }
  FinishedRig rig;
  std::vector<RigTargetLocation> locations;
  {
    const pybind11::gil_scoped_release release;
    rig = ReadFinishedRig(folder);
    const RigProblem& problem = rig.result.rig;
    std::vector<std::string> names;
    for (const RigCamera& camera : problem.cameras) names.push_back(camera.name);
    std::vector<size_t> cameras;
    for (const CameraImage& image : images) cameras.push_back(IndexOf("image", std::get<0>(image), names));
    const std::vector<StatedPose> poses =
        CorrectedPoses(rig.result, cameras, PosesOf(given, joints, problem.robots));
    std::vector<RigSighting> sightings;
    for (size_t i = 0; i < images.size(); ++i) {
      for (size_t t = 0; t < rig.targets.size(); ++t) {
        sightings.push_back({cameras[i], t,
                             DetectIn(*rig.targets[t], rig.result.solution.cameras[cameras[i]], names[cameras[i]],
                                      pixels[i], std::get<2>(images[i]))});
      }
    }
    locations = LocateTargetsInRig(rig.result, rig.targets, sightings, poses);
  }
  std::vector<pybind11::tuple> all;
  std::vector<std::string> faults;
  for (const RigTargetLocation& location : locations) {
    if (location.contradiction) throw InputError(RigLocationFault(rig.result.rig, location));
    if (location.possible.empty()) faults.push_back(RigLocationFault(rig.result.rig, location));
    std::vector<std::string> by;
    for (const size_t camera : location.cameras) by.push_back(rig.result.rig.cameras[camera].name);
    for (const LocatedTarget& located : location.possible) {
      all.push_back(pybind11::make_tuple(rig.result.rig.targets[location.target].name, by,
                                         ArrayOf(located.world_from_target),
                                         ArrayOf(located.pose_covariance.Total()), located.rms_px,
                                         location.possible.size(), located.p_value));
    }
  }
  if (all.empty()) throw InputError(faults.empty() ? "no target was detected in these images" : Join(faults, "; "));
  return all;
}

}  // namespace

void BindRigs(pybind11::module_& module) {
  using pybind11::arg;
  module.def(
      "is_rig_run",
      [](const std::filesystem::path& folder) {
        const pybind11::gil_scoped_release release;
        return IsRigResult(RunFolderOf(folder) / "result.json");
      },
      arg("folder"));
  module.def("locate_by_rig", &LocateByRig, arg("folder"), arg("images"), arg("base_from_gripper"),
             arg("joints"));
}

}  // namespace heba
