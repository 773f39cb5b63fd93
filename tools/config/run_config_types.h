// A run as its config states it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "heba/io/import.h"
#include "heba/io/pose_formats.h"
#include "heba/run_types.h"

namespace heba {

// The meaning of the numbers of a robot's pose.
struct PoseReading {
  PoseFormat format;
  bool is_base_from_gripper = true;
};

// Returns base_from_gripper of a pose that was read so.
inline Rigid3d BaseFromGripper(const PoseReading& reading, const Rigid3d& pose) {
  return reading.is_base_from_gripper ? pose : Inverse(pose);
}

// The poses of one arm as its file has them.
struct PosesFileOfArm {
  std::string section;         // The section of the config that names the file, such as captures, or robots.left.
  std::filesystem::path file;  // Empty if the poses are those of an imported data set.
  PoseReading reading;
  std::vector<std::vector<double>> numbers;  // One list per capture.
  bool joints_are_deg = false;               // Whether the file of its joints has angles in degrees.
};

// The data set, the options of the run, and how the config states them.
struct RunConfig {
  std::filesystem::path file;
  // Without Dataset::truth, which is read when the run begins. The sources of cameras and detections are files. Without
  // names, the config has the short form.
  Dataset data;
  RunOptions options;
  std::vector<PosesFileOfArm> arms;       // One per arm.
  std::vector<std::string> targets_used;  // Each target with every default filled in, as YAML.
  // One per target: whether the config itself holds the target in heba's keys, so that a setting target.KEY changes one
  // of them. Otherwise the target is in a file of its own, in an imported data set, or in Kalibr's keys.
  std::vector<bool> has_target_keys;
  std::vector<std::filesystem::path> data_files;  // The files with the poses, and those that they need.
  // These are set in the short form. The number of images (or corners, or poses of the target) counts those with and
  // those without a robot pose.
  size_t num_images = 0;
  std::vector<std::string> images_without_pose;
  std::vector<std::string> poses_without_image;
  std::optional<ImportedSet> imported;  // The data set of another project that the captures are from.
  std::optional<std::filesystem::path> truth;
  std::filesystem::path output;
  std::string used;  // The config as used, with every default filled in, as YAML.
};

}  // namespace heba
