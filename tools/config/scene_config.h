// Reads a scene to simulate.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/config/yaml_reader.h"
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

// Reads an arm from the keys model, offsets, lengths, angles, gravity, joint_noise, configurations, tool and
// record_joints.
SceneArm ReadSceneArm(MapReader& reader);

struct SceneConfig {
  Setup setup = Setup::kEyeToHand;
  std::shared_ptr<const Target> target;
  YAML::Node target_used;
  Camera camera;
  HandEye hand_eye;
  MotionOptions motion;
  int num_repeats = 1;  // The captures that are taken at each commanded pose, with one error of the robot.
  std::optional<TwoStepMotionOptions> two_step;  // Precedes the free captures of `motion`.
  RenderOptions image;
  std::optional<SceneArm> arm;
  double robot_rotation_sigma_rad = 0;
  double robot_translation_sigma_m = 0;
  PoseFormat pose_format;
  bool give_camera = true;  // Whether the data set's config names the true camera, or leaves it to be estimated.
  uint64_t seed = 1;
  YAML::Node used;  // The scene with every default filled in, without the names of files.
};

// Read the keys of `motion` that every scene has, the section `image`, and the key `camera`.
void ReadMotion(MapReader& motion, MotionOptions* options);
void ReadRendering(MapReader& root, RenderOptions* options);
Camera ReadSceneCamera(MapReader& reader);

// Reads a scene from a file and the files that it is based on; `settings` (--set) take precedence. Throws InputError
// on any error.
SceneConfig ReadSceneConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});
// Reads a scene from a mapping within another file.
SceneConfig ReadScene(const ConfigValue& value);

// Simulates the captures of the two-step method, if the scene has them, then the free ones. Returns a Failure if they
// do not fit into the image.
Outcome<std::vector<SimulatedPose>> SimulateScenePoses(const SceneConfig& scene, Rng* rng);

}  // namespace heba
