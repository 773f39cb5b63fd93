// A run's config, read and checked, and the data set that it names.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/data/dataset.h"
#include "heba/data/setup.h"
#include "heba/io/pose_formats.h"
#include "solvers/calibration.h"
#include "targets/target.h"

namespace heba {

// What the numbers of a robot's pose mean.
struct PoseReading {
  PoseFormat format;
  bool is_base_from_gripper = true;
};

struct RunConfig {
  std::filesystem::path file;
  std::string name;
  Setup setup = Setup::kEyeToHand;
  std::shared_ptr<const Target> target;
  std::string target_used;       // As YAML, every default filled in.
  std::optional<Camera> camera;  // Nothing: to be estimated. Its size is 0 x 0 if its file does not tell.
  std::string camera_model;
  std::string camera_file;  // For messages.
  std::filesystem::path poses_file;
  PoseReading pose_reading;
  std::vector<Capture> captures;
  std::vector<std::vector<double>> pose_numbers;  // Of each capture, as the poses file has them.
  std::vector<std::string> images_without_pose;
  std::string seed;
  std::vector<std::string> methods;  // Empty: all that the motion suits.
  BundleOptions bundle;
  int folds = 0;
  std::optional<std::filesystem::path> truth;
  std::filesystem::path output;
  std::string used;  // The config as used, every default filled in, as YAML.
};

// Reads the config, the files that it is based on and what they name, the pictures excepted. `settings` (--set) count
// more than the files. InputError on any fault.
RunConfig ReadRunConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

// From the keys of `captures`: pose_format, robot, joint_angles, units, poses_are.
PoseReading ReadPoseReading(MapReader& captures);
Rigid3d BaseFromGripper(const PoseReading& reading, const Rigid3d& pose);

// Reads a target from a mapping, or from the file that a path names; `reader` records it for the config as used.
std::shared_ptr<const Target> ReadTarget(MapReader& reader, const std::string& key);

}  // namespace heba
