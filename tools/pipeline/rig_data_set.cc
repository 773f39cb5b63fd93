#include "tools/pipeline/rig_data_set.h"

#include <cstdio>
#include <mutex>

#include "heba/base/files.h"
#include "heba/base/parallel.h"
#include "heba/io/camera_file.h"
#include "heba/io/pose_file.h"
#include "heba/io/result_file.h"
#include "heba/simulation/arm_captures.h"
#include "heba/simulation/rig_motion.h"
#include "targets/images/image.h"
#include "tools/config/robot_section.h"
#include "tools/files/result_folder.h"

namespace heba {
namespace {
namespace fs = std::filesystem;

std::string ImageName(size_t index) {
  char name[32];
  std::snprintf(name, sizeof(name), "%03zu.png", index);
  return name;
}

std::string PosesName(const RigSceneConfig& scene, const std::string& robot) {
  return scene.has_named_robots ? robot + ".csv" : "poses.csv";
}

std::string JointsName(const RigSceneConfig& scene, const std::string& robot) {
  return scene.has_named_robots ? robot + "_joints.csv" : "joints.csv";
}

// Returns the arms with errors drawn at random.
std::vector<std::optional<SimulatedArm>> DrawArms(const RigSceneConfig& scene, Rng* rng) {
  std::vector<std::optional<SimulatedArm>> arms;
  for (const std::optional<SceneArm>& arm : scene.arms) {
    arms.emplace_back();
    if (!arm) continue;
    arms.back() = SimulatedArm{arm->nominal, DrawArmErrors(arm->nominal, arm->sigmas, rng), arm->tip_from_gripper,
                               arm->has_several_configurations, arm->joint_noise_rad};
  }
  return arms;
}

// Adds the kinematics of an arm to the config: beside its poses or, if the scene does not name it,
// in a section of its own.
void AddArmKeys(const RigSceneConfig& scene, size_t robot, YAML::Node* config, YAML::Node* poses) {
  const SceneArm& arm = *scene.arms[robot];
  YAML::Node keys;
  keys["model"] = arm.nominal.name;
  // Recorded joints tell the tool.
  if (!arm.records_joints) keys["tool"] = PoseNode(arm.tip_from_gripper);
  if (arm.records_joints) (*poses)["joints"] = JointsName(scene, scene.rig.robots[robot]);
  if (!scene.has_named_robots) {
    (*config)["robot"] = keys;
    return;
  }
  for (const auto& entry : keys) (*poses)[entry.first] = entry.second;
}

std::string ConfigText(const RigSceneConfig& scene) {
  YAML::Node config;
  for (size_t r = 0; r < scene.rig.robots.size(); ++r) {
    const std::string& robot = scene.rig.robots[r];
    YAML::Node poses;
    poses["poses"] = PosesName(scene, robot);
    poses["pose_format"] = PoseFormatNode(scene.pose_format);
    if (scene.arms[r]) AddArmKeys(scene, r, &config, &poses);
    if (scene.has_named_robots) {
      config["robots"][robot] = poses;
    } else {
      config["captures"] = poses;
    }
  }
  for (const RigCamera& camera : scene.rig.cameras) {
    YAML::Node entry;
    entry["mount"] = camera.mount_name;
    entry["images"] = camera.name;
    entry["model"] = camera.camera.model;
    if (scene.give_camera) entry["intrinsics"] = camera.name + ".yaml";
    config["cameras"][camera.name] = entry;
  }
  for (const RigTarget& target : scene.rig.targets) {
    config["targets"][target.name]["mount"] = target.mount_name;
    config["targets"][target.name]["target"] = target.name + ".target.yaml";
  }
  config["evaluate"]["truth"] = "truth.json";
  YAML::Emitter emitter;
  emitter << config;
  return std::string(emitter.c_str()) + "\n";
}

std::string YamlText(const YAML::Node& node) {
  YAML::Emitter emitter;
  emitter << node;
  return std::string(emitter.c_str()) + "\n";
}

}  // namespace

Outcome<int> WriteRigDataSet(const RigSceneConfig& scene, const fs::path& output, int num_threads,
                             Verbosity verbosity) {
  StagedFolder folder(output, "a data set");
  const RigProblem& rig = scene.rig;
  Rng rng(scene.seed);
  const std::vector<std::optional<SimulatedArm>> arms = DrawArms(scene, &rng);
  const Outcome<RigMotion> arm_motion =
      SimulateRigMotion(rig, scene.poses, SimulatedTargets(scene), scene.options, arms, &rng);
  if (!arm_motion) return Failure{arm_motion.reason()};
  const size_t num_captures = arm_motion->exact.size();
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    std::vector<PoseRow> rows;
    for (size_t i = 0; i < num_captures; ++i) {
      PoseRow& row = rows.emplace_back();
      row.image = ImageName(i);
      row.pose = ReportedPose(arm_motion->stated[i][r], scene.options.robot_noise, &rng);
    }
    WriteFileAtomically(folder.staging() / PosesName(scene, rig.robots[r]), PoseFileText(rows, scene.pose_format));
    if (!scene.arms[r] || !scene.arms[r]->records_joints) continue;
    std::vector<std::string> images;
    std::vector<Eigen::VectorXd> joints;
    for (size_t i = 0; i < num_captures; ++i) {
      images.push_back(ImageName(i));
      joints.push_back(arm_motion->joints[i][r]);
    }
    WriteFileAtomically(folder.staging() / JointsName(scene, rig.robots[r]),
                        JointsFileText(scene.arms[r]->nominal, images, joints));
  }
  const size_t num_cameras = rig.cameras.size();
  const int num_images = static_cast<int>(num_captures * num_cameras);
  for (const RigCamera& camera : rig.cameras) fs::create_directory(folder.staging() / camera.name);
  {
    Progress progress("render", num_images, verbosity);
    std::mutex mutex;
    ParallelFor(num_images, num_threads, [&](int index) {
      const size_t i = static_cast<size_t>(index) / num_cameras;
      const size_t c = static_cast<size_t>(index) % num_cameras;
      RigPoses poses = scene.poses;
      for (const CameraMotion& motion : scene.motions) {
        Rigid3d& pose = poses.mount_from_camera[motion.camera];
        if (i >= motion.first_capture) pose = pose * motion.before_from_after;
      }
      std::vector<RenderedSheet> sheets;
      for (size_t t = 0; t < rig.targets.size(); ++t) {
        sheets.push_back({&scene.targets[t]->Draw(), CameraFromTarget(rig, poses, c, t, arm_motion->exact[i]),
                          rig.targets[t].shape});
      }
      RenderOptions options = scene.image;
      options.seed = scene.seed * 1000003 + static_cast<uint64_t>(index);
      WriteImage(folder.staging() / rig.cameras[c].name / ImageName(i),
                 RenderScene(sheets, rig.cameras[c].camera, options));
      const std::lock_guard<std::mutex> lock(mutex);
      progress.Step();
    });
  }
  RigTruth truth{scene.poses.mount_from_camera,
                 {scene.poses.mount_from_target.begin(), scene.poses.mount_from_target.end()},
                 {scene.poses.world_from_base.begin(), scene.poses.world_from_base.end()},
                 {},
                 {}};
  for (const std::optional<SimulatedArm>& arm : arms) {
    truth.arm_errors.push_back(arm ? arm->errors : Eigen::VectorXd());
  }
  for (const RigCamera& camera : rig.cameras) {
    truth.cameras.emplace_back(camera.camera);
    WriteFileAtomically(folder.staging() / (camera.name + ".yaml"), CameraToYaml(camera.camera));
  }
  for (size_t t = 0; t < rig.targets.size(); ++t) {
    WriteFileAtomically(folder.staging() / (rig.targets[t].name + ".target.yaml"), YamlText(scene.targets_used[t]));
  }
  WriteFileAtomically(folder.staging() / "config.yaml", ConfigText(scene));
  WriteFileAtomically(folder.staging() / "truth.json", RigTruthToJson(rig, truth));
  folder.Commit();
  return num_images;
}

}  // namespace heba
