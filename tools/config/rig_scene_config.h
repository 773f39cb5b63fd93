// Reads a scene with a rig to simulate.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/data/rig.h"
#include "heba/io/pose_formats.h"
#include "heba/simulation/rig_scene.h"
#include "heba/target.h"
#include "targets/render/rendering.h"
#include "tools/config/scene_config.h"

namespace heba {

// A motion of a camera during the captures: its pose is multiplied by `before_from_after` from a capture on.
struct CameraMotion {
  size_t camera = 0;
  size_t first_capture = 0;
  Rigid3d before_from_after;
};

struct RigSceneConfig {
  RigProblem rig;                             // With the true cameras, without captures.
  bool has_named_robots = false;              // Whether the scene names its arms; otherwise it has one.
  std::vector<std::optional<SceneArm>> arms;  // One per arm: its kinematics, if they have errors.
  RigPoses poses;
  std::vector<CameraMotion> motions;
  std::vector<std::shared_ptr<const Target>> targets;
  std::vector<YAML::Node> targets_used;
  RigSceneOptions options;
  RenderOptions image;
  PoseFormat pose_format;
  bool give_camera = true;  // Whether the data set's config names the true cameras, or leaves them to be estimated.
  uint64_t seed = 1;
  YAML::Node used;  // The scene with every default filled in, without the names of files.
};

// Returns whether a scene is that of a rig: whether it has `cameras`, `targets` or `robots`.
bool IsRigScene(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

// Reads a scene from a file and the files that it is based on; `settings` (--set) take precedence. Throws InputError on
// any error.
RigSceneConfig ReadRigScene(const std::filesystem::path& path, const std::vector<std::string>& settings = {});
// Reads a scene from a mapping within another file.
RigSceneConfig ReadRigScene(const ConfigValue& value);

// Returns the targets as the simulation sees them.
std::vector<SimulatedTarget> SimulatedTargets(const RigSceneConfig& scene);

}  // namespace heba
