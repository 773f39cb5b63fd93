// Keys that several kinds of configs have.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "heba/camera/camera.h"
#include "heba/config/yaml_reader.h"
#include "heba/data/camera_prior.h"
#include "heba/data/drift.h"
#include "heba/data/pair_solution.h"
#include "heba/data/target_shape.h"
#include "heba/target.h"

namespace heba {

// The reason of what a config leaves out (LeftOutImages).
inline constexpr std::string_view kExcludedReason = "left out by captures.exclude";

// Reads a target from a mapping, or from the file that a path names; `reader` records it for the config as used.
std::shared_ptr<const Target> ReadTarget(MapReader& reader, const std::string& key);
// Returns whether `key`, a target, holds the target in heba's keys (RunConfig::has_target_keys).
bool HoldsTargetKeys(MapReader& reader, const std::string& key);
// Reads a key whose value is a pose.
Rigid3d ReadPoseKey(MapReader& reader, const std::string& key);
// Reads `check.wobble`: one sigma of what the mounts on a gripper move by themselves between two sessions, along and
// about each axis.
RobotNoise ReadWobble(MapReader& root);
// Reads the key `name`, which must be able to name a folder.
std::string ReadFolderName(MapReader& reader, const std::string& fallback);
// Reads the key `output`, a folder, which is `fallback` if it is not stated.
std::filesystem::path ReadOutput(MapReader& reader, const std::filesystem::path& fallback);
// Returns what was read, with every default filled in, as YAML.
std::string UsedText(const MapReader& reader);
// Reads the key `about`: the user's own texts, for the record.
std::vector<std::pair<std::string, std::string>> ReadAbout(MapReader& root);

// The keys `model` and `intrinsics` of a camera: a file, or {file, camera} with the name of the one that is meant.
struct CameraKeys {
  std::optional<Camera> camera;  // As the model, if one is named.
  std::string source;            // The file of the camera.
  std::string model;             // Empty: the camera's own, or to be chosen.
};
CameraKeys ReadCameraKeys(MapReader& reader);
// Returns the camera converted to a model, unless that is empty. Throws InputError at `asked` if that is not possible.
Camera AsModel(const Camera& camera, const std::string& model, const ConfigValue& asked);

// Reads the key `intrinsics` of `refine`, the groups of free parameters: a list without repetitions.
std::vector<ParameterGroup> ReadFreeIntrinsics(MapReader& reader, const std::vector<ParameterGroup>& fallback);
// Reads such a list, and returns its node in a config as used.
std::vector<ParameterGroup> ReadParameterGroups(const ConfigValue& value);
YAML::Node ParameterGroupsNode(const std::vector<ParameterGroup>& groups);

// Reads the key `intrinsics_prior` of `refine`: file, the sigmas in the file of the camera, or none. Without the key it
// is file if that file has sigmas and the camera has free parameters, unless `is_none_without_key`. Returns the prior,
// if there is one. `camera_key` is the key of a camera file, for the message about a prior without one.
std::optional<CameraPrior> ReadIntrinsicsPrior(MapReader& refine, const CameraKeys& camera,
                                               const std::vector<ParameterGroup>& free, const std::string& camera_key,
                                               bool is_none_without_key = false);

// The key `target_shape` of `refine`.
struct FreeShape {
  bool is_chosen = false;                // Whether the free parts are chosen from the captures.
  std::vector<TargetShapeGroup> groups;  // The unknown parts if they are not chosen, ordered as TargetShapeGroup.
};
FreeShape ReadFreeShape(MapReader& refine);
// The keys of TargetShape::params where a true shape is stated.
inline constexpr std::array<const char*, TargetShape::kNumParams> kTargetShapeKeys = {
    "scale_x", "scale_y", "bend_x", "bend_y", "twist", "cubic_xxx", "cubic_xxy", "cubic_xyy", "cubic_yyy"};

// Reads the key `drift` of `refine`. A list has names of bodies, each with what it stands for.
DriftOptions ReadDrift(MapReader& refine, const std::vector<std::pair<std::string, DriftBody>>& bodies);

// Reads the key `pixel_noise` of `refine`, px; nothing if it is to be estimated.
std::optional<double> ReadPixelNoise(MapReader& refine);

}  // namespace heba
