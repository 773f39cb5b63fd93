#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <mutex>

#include "heba/base/error.h"
#include "heba/base/files.h"
#include "heba/base/parallel.h"
#include "heba/io/camera_file.h"
#include "heba/io/pose_file.h"
#include "heba/io/result_file.h"
#include "targets/images/image.h"
#include "tools/cli/command.h"
#include "tools/cli/flags.h"
#include "tools/config/scene_config.h"
#include "tools/files/result_folder.h"
#include "tools/text/console.h"

namespace heba {
namespace {

std::string ImageName(int index) {
  char name[32];
  std::snprintf(name, sizeof(name), "%03d.png", index);
  return name;
}

// Returns a run config for the data set, ready for `heba run`.
std::string RunConfigText(const SceneConfig& scene) {
  YAML::Node config;
  config["setup"] = std::string(SetupName(scene.setup));
  config["target"] = "target.yaml";
  config["camera"]["model"] = scene.camera.model;
  if (scene.give_camera) config["camera"]["intrinsics"] = "camera.yaml";
  config["captures"]["images"] = "images";
  config["captures"]["poses"] = "poses.csv";
  config["captures"]["pose_format"] = PoseFormatNode(scene.pose_format);
  config["evaluate"]["truth"] = "truth.json";
  YAML::Emitter emitter;
  emitter << config;
  return std::string(emitter.c_str()) + "\n";
}

}  // namespace

int RunCommand_simulate(const std::vector<std::string>& arguments) {
  namespace fs = std::filesystem;
  if (FLAGS_out.empty()) throw InputError("'heba simulate' needs --out DIR");
  const SceneConfig scene = ReadSceneConfig(arguments[0], Settings());
  StagedFolder folder(FLAGS_out, "a data set");
  const Drawing& drawing = scene.target->Draw();
  Rng rng(scene.seed);
  const Outcome<std::vector<SimulatedPose>> poses = SimulateScenePoses(scene, &rng);
  if (!poses) {
    PrintError(arguments[0] + ": " + poses.reason());
    return kWorkFailed;
  }
  fs::create_directory(folder.staging() / "images");
  std::vector<PoseRow> rows;
  for (size_t i = 0; i < poses->size(); ++i) {
    const Rigid3d true_pose =
        BaseFromGripper(scene.setup, CameraMountFromTargetMount(scene.hand_eye, (*poses)[i].camera_from_target));
    PoseRow row;
    row.image = ImageName(static_cast<int>(i));
    row.role = (*poses)[i].role;
    row.pose = WithRobotNoise(true_pose, scene.robot_rotation_sigma_rad, scene.robot_translation_sigma_m, &rng);
    rows.push_back(row);
  }
  {
    Progress progress("render", static_cast<int>(rows.size()), FLAGS_quiet ? Verbosity::kQuiet : Verbosity::kNormal);
    std::mutex mutex;
    ParallelFor(static_cast<int>(rows.size()), NumThreads(), [&](int index) {
      const size_t i = static_cast<size_t>(index);
      RenderOptions options = scene.image;
      options.seed = scene.seed * 1000003 + i;
      WriteImage(folder.staging() / "images" / rows[i].image,
                 RenderView(drawing, scene.camera, (*poses)[i].camera_from_target, options));
      const std::lock_guard<std::mutex> lock(mutex);
      progress.Step();
    });
  }
  YAML::Emitter target;
  target << scene.target_used;
  WriteFileAtomically(folder.staging() / "target.yaml", std::string(target.c_str()) + "\n");
  WriteFileAtomically(folder.staging() / "camera.yaml", CameraToYaml(scene.camera));
  WriteFileAtomically(folder.staging() / "poses.csv", PoseFileText(rows, scene.pose_format));
  WriteFileAtomically(folder.staging() / "config.yaml", RunConfigText(scene));
  WriteFileAtomically(
      folder.staging() / "truth.json",
      TruthToJson({scene.hand_eye.camera_mount_from_camera, scene.hand_eye.target_mount_from_target, scene.camera},
                  scene.setup));
  folder.Commit();
  if (!FLAGS_quiet) {
    std::cout << rows.size() << " images with ground truth in " << FLAGS_out << "; next: heba run "
              << (fs::path(FLAGS_out) / "config.yaml").string() << std::endl;
  }
  return kDone;
}

}  // namespace heba
