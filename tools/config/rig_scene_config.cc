#include "tools/config/rig_scene_config.h"

#include <limits>
#include <tuple>

#include "heba/detection.h"
#include "tools/config/common_keys.h"
#include "tools/config/file_kind.h"
#include "tools/config/rig_keys.h"
#include "tools/config/robot_noise_config.h"
#include "tools/run/arm_keys.h"

namespace heba {
namespace {

ConfigValue ReadSceneFile(const std::filesystem::path& path, const std::vector<std::string>& settings) {
  RefuseFolder(path, FileKind::kScene);
  const ConfigValue file = ReadYamlFileOverBases(path, {});
  return settings.empty() ? file : ConfigValue::Stack({ParseSettings(settings), file});
}

// Reads the key `pose`.
Rigid3d ReadPoseKey(MapReader& reader, const std::string& key) {
  const Rigid3d pose = ReadPose(reader.Get(key));
  reader.Record(key, PoseNode(pose));
  return pose;
}

// The pose near which the gripper of an arm stands if nothing else determines it.
Rigid3d DefaultHome() { return {ExpRotation({0, DegToRad(180.0), 0}), Eigen::Vector3d(0.4, 0, 0.4)}; }

void ReadSceneRobots(MapReader& root, RigSceneConfig* scene) {
  if (!root.Has("robots")) {
    scene->rig.robots = {kOnlyArm};
    scene->poses.world_from_base = {Rigid3d()};
    scene->options.homes = {DefaultHome()};
    scene->arms.emplace_back();
    if (root.Has("robot")) {
      MapReader robot(root.Get("robot"));
      scene->arms.back() = ReadSceneArm(robot);
      robot.Finish();
      root.Record("robot", robot.used());
    }
    return;
  }
  MapReader section(root.Get("robots"));
  scene->rig.robots = NamesIn(section, "left");
  scene->has_named_robots = true;
  for (const std::string& name : scene->rig.robots) {
    MapReader reader(section.Get(name));
    const bool is_first = scene->poses.world_from_base.empty();
    if (is_first && reader.Has("world_from_base")) {
      reader.Get("world_from_base").Fail("the base of the first arm is the world; leave the key out");
    }
    scene->poses.world_from_base.push_back(is_first ? Rigid3d() : ReadPoseKey(reader, "world_from_base"));
    scene->arms.emplace_back();
    if (reader.Has("model")) scene->arms.back() = ReadSceneArm(reader);
    scene->options.homes.push_back(reader.Has("home") ? ReadPoseKey(reader, "home") : DefaultHome());
    reader.Finish();
    section.Record(name, reader.used());
  }
  section.Finish();
  root.Record("robots", section.used());
}

void ReadSceneCameras(MapReader& root, RigSceneConfig* scene) {
  MapReader section(root.Get("cameras"));
  for (const std::string& name : CameraNamesIn(section)) {
    MapReader reader(section.Get(name));
    RigCamera camera;
    camera.name = name;
    std::tie(camera.mount, camera.mount_name) = ReadMount(reader, scene->rig.robots);
    scene->poses.mount_from_camera.push_back(ReadPoseKey(reader, "pose"));
    camera.camera = ReadSceneCamera(reader);
    if (reader.Has("moved")) {
      MapReader moved(reader.Get("moved"));
      const int from = moved.Int("from", {0, 10000});
      scene->motions.push_back({scene->rig.cameras.size(), static_cast<size_t>(from), ReadPoseKey(moved, "by")});
      moved.Finish();
      reader.Record("moved", moved.used());
    }
    reader.Finish();
    section.Record(name, reader.used());
    scene->rig.cameras.push_back(std::move(camera));
  }
  section.Finish();
  root.Record("cameras", section.used());
}

void ReadSceneTargets(MapReader& root, RigSceneConfig* scene) {
  MapReader section(root.Get("targets"));
  for (const std::string& name : NamesIn(section, "plate")) {
    MapReader reader(section.Get(name));
    RigTarget target;
    target.name = name;
    std::tie(target.mount, target.mount_name) = ReadMount(reader, scene->rig.robots);
    scene->poses.mount_from_target.push_back(ReadPoseKey(reader, "pose"));
    scene->targets.push_back(ReadTarget(reader, "target"));
    scene->targets_used.push_back(reader.used()["target"]);
    target.shape = DesignedShape(AllPoints(*scene->targets.back()).points_in_target);
    reader.Finish();
    section.Record(name, reader.used());
    scene->rig.targets.push_back(std::move(target));
  }
  section.Finish();
  root.Record("targets", section.used());
}

}  // namespace

bool IsRigScene(const std::filesystem::path& path, const std::vector<std::string>& settings) {
  return HasRigKeys(ReadSceneFile(path, settings));
}

RigSceneConfig ReadRigScene(const std::filesystem::path& path, const std::vector<std::string>& settings) {
  const ConfigValue value = ReadSceneFile(path, settings);
  RefuseOtherKind(value, path, FileKind::kScene);
  return ReadRigScene(value);
}

RigSceneConfig ReadRigScene(const ConfigValue& value) {
  RigSceneConfig scene;
  MapReader reader(value);
  ReadSceneRobots(reader, &scene);
  ReadSceneCameras(reader, &scene);
  ReadSceneTargets(reader, &scene);
  MapReader motion = reader.Section("motion");
  ReadMotion(motion, &scene.options.motion);
  if (scene.options.motion.num_captures == 0) motion.Get("captures").Fail("must be at least 1");
  motion.Finish();
  reader.Record("motion", motion.used());
  const std::string motion_faults = scene.options.motion.Check();
  if (!motion_faults.empty()) motion.value().Fail(motion_faults);
  ReadRendering(reader, &scene.image);
  MapReader robot = reader.Section("robot_noise");
  scene.options.robot_noise = ReadRobotNoise(robot, 0.0);
  reader.Record("robot_noise", robot.used());
  scene.pose_format = *FindPoseFormat("ros");
  if (const std::optional<ConfigValue> format = reader.Find("pose_format")) scene.pose_format = ReadPoseFormat(*format);
  reader.Record("pose_format", PoseFormatNode(scene.pose_format));
  scene.give_camera = reader.Bool("give_camera", true);
  scene.seed = static_cast<uint64_t>(reader.Int("seed", {0, std::numeric_limits<int>::max()}, 1));
  reader.Finish();
  scene.used = reader.used();
  return scene;
}

std::vector<SimulatedTarget> SimulatedTargets(const RigSceneConfig& scene) {
  std::vector<SimulatedTarget> targets;
  for (const std::shared_ptr<const Target>& target : scene.targets) {
    targets.push_back({AllPoints(*target).points_in_target, target->Draw().y_up});
  }
  return targets;
}

}  // namespace heba
