// Reads a scene to simulate: that of several cameras, targets and arms under names, or its short form with one of each
// and no names.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/config/yaml_reader.h"
#include "heba/data/pair_problem.h"
#include "heba/data/problem.h"
#include "heba/data/setup.h"
#include "heba/io/pose_formats.h"
#include "heba/simulation/arm_captures.h"
#include "heba/simulation/scene.h"
#include "heba/target.h"
#include "targets/render/rendering.h"

namespace heba {

// An arm with errors of its parameters, which its controller does not know.
struct SceneArm {
  Arm nominal;
  Rigid3d tip_from_gripper;
  ArmErrorSigmas sigmas;
  double joint_noise_rad = 0;  // One sigma of each turning joint in each commanded pose.
  bool has_several_configurations = true;
  bool records_joints = false;  // Whether the data set has the joints.
};

struct SceneTarget {
  std::shared_ptr<const Target> target;
  YAML::Node used;
  TargetShape printed;  // The shape of the sheet in space.
};

// A motion of a camera during the captures: its pose is multiplied by `before_from_after` from a capture on.
struct CameraMotion {
  size_t camera = 0;
  size_t first_capture = 0;
  Rigid3d before_from_after;
};
// A motion of a camera that goes on through all captures; its pose is that at the last one.
struct CameraCreep {
  size_t camera = 0;
  Tangent6 change = Tangent6::Zero();  // From the first capture to the last, in the camera's frame.
};

struct SceneConfig {
  std::optional<Setup> setup;     // That of the short form, whose camera, target and arm have empty names.
  Problem problem;                // With the true cameras and the targets as they are designed, without captures.
  bool has_named_robots = false;  // Whether the scene names its arms; otherwise it has one.
  std::vector<std::optional<SceneArm>> arms;  // One per arm: its kinematics, if they have errors.
  CellPoses poses;
  std::vector<CameraMotion> camera_motions;
  std::vector<CameraCreep> camera_creeps;
  std::vector<SceneTarget> targets;
  SceneOptions options;  // The motion, the noise of the arms' poses and their homes.
  int num_repeats = 1;   // The captures that are taken at each commanded pose, with one error of the robot.
  std::optional<TwoStepMotionOptions> two_step;  // Precedes the free captures of the motion; for the short form.
  RenderOptions image;
  PoseFormat pose_format;
  bool give_camera = true;  // Whether the data set's config names the true cameras, or leaves them to be estimated.
  uint64_t seed = 1;
  YAML::Node used;  // The scene with every default filled in, without the names of files.
};

// Reads a scene from a file and the files that it is based on; `settings` (--set) take precedence. Throws InputError
// on any error.
SceneConfig ReadSceneConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});
// Reads a scene from a mapping within another file.
SceneConfig ReadScene(const ConfigValue& value);

// Returns the poses of the camera and the target of the short form.
HandEye HandEyeOf(const SceneConfig& scene);
// Returns the targets as the simulation sees them.
std::vector<SimulatedTarget> SimulatedTargets(const SceneConfig& scene);

// Simulates the captures of the short form: those of the two-step method, if the scene has them, then the free ones.
// Returns a Failure if they do not fit into the image.
Outcome<std::vector<SimulatedPose>> SimulateScenePoses(const SceneConfig& scene, Rng& rng);

}  // namespace heba
