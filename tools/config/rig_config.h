// The config of a run with a rig (several cameras, targets or arms), read and checked, with the data set that it names.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/rig_run.h"
#include "tools/config/run_config.h"

namespace heba {

// The poses of one arm as its file has them.
struct RigArmPoses {
  std::string section;  // The section of the config that names the file, such as robots.left.
  std::filesystem::path file;
  PoseReading reading;
  std::vector<std::vector<double>> numbers;  // One list per capture.
  bool joints_are_deg = false;               // Whether the file of its joints has angles in degrees.
};

struct RigConfig {
  std::filesystem::path file;
  RigDataset data;  // Without RigDataset::truth, which is read when the run begins.
  RigRunOptions options;
  std::vector<RigArmPoses> arms;                  // One per arm.
  std::vector<std::string> targets_used;          // Each target with every default filled in, as YAML.
  std::vector<bool> has_target_keys;              // One per target: RunConfig::has_target_keys.
  std::vector<std::filesystem::path> data_files;  // The files with the poses.
  std::optional<std::filesystem::path> truth;
  std::filesystem::path output;
  std::string used;  // The config as used, with every default filled in, as YAML.
};

// Returns whether a config is that of a rig: whether it has `cameras`, `targets` or `robots`. Throws InputError if it
// cannot be read.
bool IsRigConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

// Reads the config, the files that it is based on, and the files that they name, except for the images. Throws
// InputError on any error.
RigConfig ReadRigConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

}  // namespace heba
