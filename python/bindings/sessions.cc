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
#include "heba/capture_plan.h"
#include "heba/session_check.h"
#include "python/bindings/arrays.h"
#include "python/bindings/bindings.h"
#include "python/bindings/names.h"
#include "tools/config/finished_run.h"
#include "tools/config/plan_config.h"
#include "tools/config/scene_config.h"
#include "tools/files/check_file.h"
#include "tools/pipeline/cell_init.h"
#include "tools/pipeline/checked_session.h"
#include "tools/pipeline/data_set.h"
#include "tools/text/check_text.h"
#include "tools/text/console.h"
#include "tools/text/failure_text.h"
#include "tools/text/plan_text.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

std::string Argument(const std::string& name, const std::string& value) {
  return value.empty() ? name : name + "=\"" + value + "\"";
}

// Makes a config of a folder of images and poses. Returns its path, the warnings and the remarks.
std::tuple<fs::path, std::vector<std::string>, std::vector<std::string>> Init(
    const fs::path& folder, const fs::path& out, const std::string& images, const std::string& poses,
    const std::string& camera, const std::string& target, const std::string& setup, bool is_forced, int num_threads) {
  const pybind11::gil_scoped_release release;
  const InitRequest request = RequestOf(folder, out, {images, poses, camera, target, setup}, is_forced, Argument);
  std::optional<RawConfig> made = InitDataSet(request, num_threads);
  if (!made) {
    const RawFolder files = FilesToRead(request);
    CheckTarget(request, files, num_threads);
    made = InitFolder(request, files, num_threads);
  }
  if (!made->fits) throw InputError(folder.string() + ": " + WhyNoConfig(*made));
  return {request.config, std::move(made->warnings), std::move(made->remarks)};
}

// Writes the data set of a scene, and returns the config for a run of it.
fs::path Simulate(const fs::path& scene_path, const std::vector<std::string>& settings, const fs::path& out,
                  int num_threads) {
  const pybind11::gil_scoped_release release;
  const SceneConfig scene = ReadSceneConfig(scene_path, settings);
  RefuseArms(scene, scene_path.string());
  const Outcome<int> num_images = WriteDataSet(scene, out, num_threads, Verbosity::kQuiet);
  if (!num_images) throw InputError(scene_path.string() + ": " + num_images.reason());
  return out / "config.yaml";
}

// Returns, for each planned capture, the name of its image, base_from_gripper, its joints (rad or m; empty without an
// arm), the share of rough set-ups in which the target is seen, and the sigmas that are expected after it: of a located
// target (m), of the camera's position (m) and of its orientation (rad); and the table of the plan.
pybind11::tuple Plan(const fs::path& cell, const std::vector<std::string>& settings, int count, bool is_two_step) {
  PlanConfig config;
  std::optional<CapturePlan> plan;
  {
    const pybind11::gil_scoped_release release;
    config = ReadPlanConfig(cell, settings);
    PlanOptions options;
    options.count = count;
    options.num_revisits = config.num_revisits;
    options.is_two_step = is_two_step;
    Outcome<CapturePlan> planned = PlanCaptures(config.cell, options);
    if (!planned) throw InputError(cell.string() + ": " + FailureText(planned.failure()));
    plan = std::move(*planned);
  }
  const std::vector<std::string> images = PlannedImages(*plan, config.former_names);
  std::vector<pybind11::tuple> captures;
  for (size_t i = 0; i < images.size(); ++i) {
    const PlannedCapture& capture = plan->captures[i];
    captures.push_back(
        pybind11::make_tuple(images[i], ArrayOf(capture.base_from_gripper),
                             std::vector<double>(capture.posture.joints.begin(), capture.posture.joints.end()),
                             capture.visible_share, capture.target_m, capture.position_m, capture.orientation_rad));
  }
  return pybind11::make_tuple(captures, PlanTable(config.requirements, *plan, config.former_names));
}

// The poses of an arm, n x 4 x 4, or the path of their file, and its joints in the same way; the name of the only arm
// is empty.
using ArmSession =
    std::tuple<std::string, std::optional<DoubleArray>, fs::path, std::vector<std::vector<double>>, fs::path>;

// Returns the poses of all arms at each image.
std::vector<ArmsAtImage> PosesAtImages(const FinishedRun& run, const std::vector<ArmSession>& arms,
                                       const std::vector<std::optional<std::vector<Rigid3d>>>& poses_of_arms,
                                       const std::vector<SessionImage>& images) {
  const std::vector<std::string>& robots = run.result.rig.robots;
  std::vector<ArmsAtImage> at_images(images.size(), ArmsAtImage(robots.size()));
  std::vector<bool> has_poses(robots.size(), false);
  for (size_t a = 0; a < arms.size(); ++a) {
    const auto& [name, array, poses_file, joints, joints_file] = arms[a];
    const size_t r = IndexOfArm("poses", name, robots);
    has_poses[r] = true;
    if ((!joints.empty() || !joints_file.empty()) && FindEstimatedArm(run.result, r) == nullptr) {
      throw InputError("joints: the run has not estimated the errors of the arm" +
                       (robots[r].empty() ? "" : " " + robots[r]) + "; leave them out");
    }
    if (!poses_of_arms[a]) {
      const std::vector<GivenArmPose> given = PosesOfImages(run, r, poses_file, joints_file, images);
      for (size_t i = 0; i < images.size(); ++i) at_images[i][r] = given[i];
      continue;
    }
    for (size_t i = 0; i < images.size(); ++i) {
      at_images[i][r].base_from_gripper = (*poses_of_arms[a])[i];
      if (joints.empty()) continue;
      at_images[i][r].joints =
          Eigen::Map<const Eigen::VectorXd>(joints[i].data(), static_cast<Eigen::Index>(joints[i].size()));
    }
  }
  for (size_t r = 0; r < robots.size(); ++r) {
    if (has_poses[r]) continue;
    throw InputError("poses: those of " + (robots[r].empty() ? "the arm" : "arm " + robots[r]) + " are needed");
  }
  return at_images;
}

// Checks images, each with the name of its camera, against a run: at poses of the arms or, if there is one, beside
// reference images. Returns the file of `heba check --json`, and a note for each image that is not used.
std::pair<std::string, std::vector<std::string>> Check(const fs::path& folder,
                                                       const std::vector<std::pair<std::string, fs::path>>& named,
                                                       const std::vector<ArmSession>& arms, bool is_target_in_place,
                                                       const std::optional<fs::path>& reference, int num_threads) {
  std::vector<std::optional<std::vector<Rigid3d>>> poses_of_arms;
  for (const ArmSession& arm : arms) {
    const std::optional<DoubleArray>& array = std::get<1>(arm);
    poses_of_arms.push_back(array ? std::optional(PosesFrom(*array)) : std::nullopt);
  }
  const pybind11::gil_scoped_release release;
  const FinishedRun run = ReadFinishedRun(folder);
  std::vector<std::string> cameras;
  for (const ProblemCamera& camera : run.result.rig.cameras) cameras.push_back(camera.name);
  std::vector<SessionImage> images;
  for (const auto& [name, path] : named) {
    if (name.empty() && cameras.size() > 1) {
      throw InputError("images: the run is that of a rig; a dictionary by the names of its cameras is needed: " +
                       Join(cameras, ", "));
    }
    images.push_back({name.empty() ? 0 : IndexOf("images", name, cameras), path});
  }
  const CheckedSession session = reference
                                     ? SessionBesideReferences(run, *reference, images, num_threads)
                                     : SessionAtPoses(run, images, PosesAtImages(run, arms, poses_of_arms, images),
                                                      is_target_in_place, num_threads);
  const Outcome<SessionCheck> check = CheckSession(session.problem, session.solution, session.options);
  return {check ? CheckToJson(session.problem, *check)
                : UndecidedToJson(WhyUndecided(check.failure(), images, num_threads)),
          session.notes};
}

}  // namespace

void BindSessions(pybind11::module_& module) {
  using pybind11::arg;
  module.def("init", &Init, arg("folder"), arg("out"), arg("images"), arg("poses"), arg("camera"), arg("target"),
             arg("setup"), arg("is_forced"), arg("num_threads"));
  module.def("simulate", &Simulate, arg("scene"), arg("settings"), arg("out"), arg("num_threads"));
  module.def("plan", &Plan, arg("cell"), arg("settings"), arg("count"), arg("is_two_step"));
  module.def("check", &Check, arg("folder"), arg("images"), arg("arms"), arg("is_target_in_place"), arg("reference"),
             arg("num_threads"));
}

}  // namespace heba
