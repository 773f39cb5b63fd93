#include "tools/pipeline/data_set.h"

#include <cstdio>
#include <mutex>

#include "heba/base/files.h"
#include "heba/base/parallel.h"
#include "heba/io/camera_file.h"
#include "heba/io/pose_file.h"
#include "heba/io/result_file.h"
#include "targets/images/image.h"
#include "tools/config/common_keys.h"
#include "tools/config/robot_section.h"
#include "tools/files/result_folder.h"
#include "tools/pipeline/scene_captures.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

std::string ImageName(size_t index) {
  char name[32];
  std::snprintf(name, sizeof(name), "%03zu.png", index);
  return name;
}

// Return the files of an object; one without a name is the only one of its kind.
std::string ImageFolder(const ProblemCamera& camera) { return camera.name.empty() ? "images" : camera.name; }
std::string CameraFile(const ProblemCamera& camera) { return (camera.name.empty() ? "camera" : camera.name) + ".yaml"; }
std::string TargetFile(const ProblemTarget& target) {
  return target.name.empty() ? "target.yaml" : target.name + ".target.yaml";
}
std::string PosesFile(const SceneConfig& scene, size_t robot) {
  return (scene.has_named_robots ? scene.problem.robots[robot] : "poses") + ".csv";
}
std::string JointsFile(const SceneConfig& scene, size_t robot) {
  return scene.has_named_robots ? scene.problem.robots[robot] + "_joints.csv" : "joints.csv";
}

// One sigma of a simulated length, which is exact unless the scene says otherwise.
constexpr int kExact = 0;

// Returns the mapping of a target. A print that deviates from its design is not exact.
YAML::Node TargetNode(const SceneTarget& target) {
  YAML::Node node = YAML::Clone(target.used);
  const auto& params = target.printed.params;
  const bool is_exact = params[0] == 1 && params[1] == 1;
  if (is_exact && !target.target->scale_sigma()) node["scale_sigma"] = kExact;
  return node;
}

std::string YamlText(const YAML::Node& node) {
  YAML::Emitter emitter;
  emitter << node;
  return std::string(emitter.c_str()) + "\n";
}

YAML::Node ShortConfig(const SceneConfig& scene) {
  YAML::Node config;
  const ProblemCamera& camera = scene.problem.cameras[0];
  config["setup"] = std::string(SetupName(*scene.setup));
  config["target"] = TargetFile(scene.problem.targets[0]);
  config["camera"]["model"] = camera.camera.model;
  if (scene.give_camera) config["camera"]["intrinsics"] = CameraFile(camera);
  config["captures"]["images"] = ImageFolder(camera);
  config["captures"]["poses"] = PosesFile(scene, 0);
  config["captures"]["pose_format"] = PoseFormatNode(scene.pose_format);
  config["evaluate"]["truth"] = "truth.json";
  config["robot"]["scale_sigma"] = kExact;
  if (const std::optional<SceneArm>& arm = scene.arms[0]) {
    config["robot"]["model"] = arm->nominal.name;
    config["robot"]["tool"] = PoseNode(arm->tip_from_gripper);
    if (arm->records_joints) config["captures"]["joints"] = JointsFile(scene, 0);
  }
  return config;
}

// Returns the keys of what is known about an arm.
YAML::Node ArmKeys(const std::optional<SceneArm>& arm) {
  YAML::Node keys;
  keys["scale_sigma"] = kExact;
  if (arm) keys["model"] = arm->nominal.name;
  // Recorded joints determine the tool.
  if (arm && !arm->records_joints) keys["tool"] = PoseNode(arm->tip_from_gripper);
  return keys;
}

YAML::Node NamedConfig(const SceneConfig& scene) {
  YAML::Node config;
  for (size_t r = 0; r < scene.problem.robots.size(); ++r) {
    YAML::Node poses;
    poses["poses"] = PosesFile(scene, r);
    poses["pose_format"] = PoseFormatNode(scene.pose_format);
    if (scene.arms[r] && scene.arms[r]->records_joints) poses["joints"] = JointsFile(scene, r);
    // An arm's keys are beside its poses or, if the scene does not name the arm, in a section of their own.
    const YAML::Node keys = ArmKeys(scene.arms[r]);
    if (scene.has_named_robots) {
      for (const auto& entry : keys) poses[entry.first] = entry.second;
      config["robots"][scene.problem.robots[r]] = poses;
    } else {
      config["robot"] = keys;
      config["captures"] = poses;
    }
  }
  for (const ProblemCamera& camera : scene.problem.cameras) {
    YAML::Node entry;
    entry["mount"] = camera.mount_name;
    entry["images"] = ImageFolder(camera);
    entry["model"] = camera.camera.model;
    if (scene.give_camera) entry["intrinsics"] = CameraFile(camera);
    config["cameras"][camera.name] = entry;
  }
  for (const ProblemTarget& target : scene.problem.targets) {
    config["targets"][target.name]["mount"] = target.mount_name;
    config["targets"][target.name]["target"] = TargetFile(target);
  }
  config["evaluate"]["truth"] = "truth.json";
  return config;
}

std::string TruthText(const SceneConfig& scene, const std::vector<Eigen::VectorXd>& arm_errors) {
  const CellPoses& poses = scene.poses;
  if (scene.setup) {
    return TruthToJson(
        {poses.mount_from_camera[0], poses.mount_from_target[0], scene.problem.cameras[0].camera, arm_errors[0]},
        *scene.setup);
  }
  CellTruth truth{poses.mount_from_camera,
                  {poses.mount_from_target.begin(), poses.mount_from_target.end()},
                  {poses.world_from_base.begin(), poses.world_from_base.end()},
                  {},
                  arm_errors};
  for (const ProblemCamera& camera : scene.problem.cameras) truth.cameras.emplace_back(camera.camera);
  return TruthToJson(scene.problem, truth);
}

// Writes the poses of each arm, and its joints if the scene records them.
void WriteArms(const SceneConfig& scene, const std::vector<SceneCapture>& captures, const fs::path& folder) {
  for (size_t r = 0; r < scene.arms.size(); ++r) {
    std::vector<PoseRow> rows;
    std::vector<std::string> images;
    std::vector<Eigen::VectorXd> joints;
    for (const SceneCapture& capture : captures) {
      images.push_back(ImageName(images.size()));
      joints.push_back(capture.joints[r]);
      PoseRow& row = rows.emplace_back();
      row.image = images.back();
      row.role = capture.role;
      row.pose = capture.reported[r];
    }
    WriteFileAtomically(folder / PosesFile(scene, r), PoseFileText(rows, scene.pose_format));
    if (!scene.arms[r] || !scene.arms[r]->records_joints) continue;
    WriteFileAtomically(folder / JointsFile(scene, r), JointsFileText(scene.arms[r]->nominal, images, joints));
  }
}

// Renders the images of each camera, and returns how many there are.
int WriteImages(const SceneConfig& scene, const std::vector<SceneCapture>& captures, const fs::path& folder,
                int num_threads, Verbosity verbosity) {
  const std::vector<ProblemCamera>& cameras = scene.problem.cameras;
  const int num_images = static_cast<int>(captures.size() * cameras.size());
  for (const ProblemCamera& camera : cameras) fs::create_directory(folder / ImageFolder(camera));
  Progress progress("render", num_images, verbosity);
  std::mutex mutex;
  ParallelFor(num_images, num_threads, [&](int index) {
    const size_t i = static_cast<size_t>(index) / cameras.size();
    const size_t c = static_cast<size_t>(index) % cameras.size();
    std::vector<RenderedSheet> sheets;
    for (size_t t = 0; t < scene.targets.size(); ++t) {
      sheets.push_back(
          {&scene.targets[t].target->Draw(), captures[i].camera_from_target[c][t], scene.targets[t].printed});
    }
    RenderOptions options = scene.image;
    options.seed = scene.seed * 1000003 + static_cast<uint64_t>(index);
    WriteImage(folder / ImageFolder(cameras[c]) / ImageName(i), RenderScene(sheets, cameras[c].camera, options));
    const std::lock_guard<std::mutex> lock(mutex);
    progress.Step();
  });
  return num_images;
}

}  // namespace

void RefuseArms(const SceneConfig& scene, const std::string& path) {
  for (size_t r = 0; r < scene.arms.size(); ++r) {
    if (!scene.arms[r]) continue;
    if (scene.two_step) throw InputError(path + ": motion.two_step cannot be combined with robot");
    constexpr int kMostJoints = 6;
    if (scene.arms[r]->nominal.num_joints() <= kMostJoints) continue;
    throw InputError(path + ": " + (scene.has_named_robots ? "robots." + scene.problem.robots[r] : "robot") +
                     ".model: a redundant arm reaches a pose in infinitely many ways; choose one with six joints");
  }
}

Outcome<int> WriteDataSet(const SceneConfig& scene, const fs::path& output, int num_threads, Verbosity verbosity) {
  StagedFolder folder(output, "a data set");
  const Outcome<SceneCaptures> drawn = DrawSceneCaptures(scene);
  if (!drawn) return drawn.failure();
  WriteArms(scene, drawn->captures, folder.staging());
  const int num_images = WriteImages(scene, drawn->captures, folder.staging(), num_threads, verbosity);
  for (const ProblemCamera& camera : scene.problem.cameras) {
    WriteFileAtomically(folder.staging() / CameraFile(camera), CameraToYaml(camera.camera));
  }
  for (size_t t = 0; t < scene.targets.size(); ++t) {
    WriteFileAtomically(folder.staging() / TargetFile(scene.problem.targets[t]),
                        YamlText(TargetNode(scene.targets[t])));
  }
  WriteFileAtomically(folder.staging() / "config.yaml",
                      YamlText(scene.setup ? ShortConfig(scene) : NamedConfig(scene)));
  WriteFileAtomically(folder.staging() / "truth.json", TruthText(scene, drawn->arm_errors));
  folder.Commit();
  return num_images;
}

}  // namespace heba
