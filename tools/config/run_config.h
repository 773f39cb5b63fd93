// A run's config, read and checked, with the data set that it names, of any number of cameras, targets and arms.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/config/yaml_reader.h"
#include "heba/run.h"
#include "tools/config/pair_config.h"

namespace heba {

// The poses of one arm as its file has them.
struct PosesFileOfArm {
  std::string section;  // The section of the config that names the file, such as robots.left.
  std::filesystem::path file;
  PoseReading reading;
  std::vector<std::vector<double>> numbers;  // One list per capture.
  bool joints_are_deg = false;               // Whether the file of its joints has angles in degrees.
};

struct RunConfig {
  std::filesystem::path file;
  Dataset data;  // Without Dataset::truth, which is read when the run begins.
  RunOptions options;
  std::vector<PosesFileOfArm> arms;               // One per arm.
  std::vector<std::string> targets_used;          // Each target with every default filled in, as YAML.
  std::vector<bool> has_target_keys;              // One per target: PairConfig::has_target_keys.
  std::vector<std::filesystem::path> data_files;  // The files with the poses.
  std::optional<std::filesystem::path> truth;
  std::filesystem::path output;
  std::string used;  // The config as used, with every default filled in, as YAML.
};

// Returns whether a config is that of a rig: whether it has `cameras`, `targets` or `robots`. Throws InputError if it
// cannot be read.
bool IsLongConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

// Reads the config, the files that it is based on, and the files that they name, except for the images. Throws
// InputError on any error.
RunConfig ReadRunConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

}  // namespace heba
