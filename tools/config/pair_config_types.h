// A run of one camera, one target and one arm as its config states it.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/io/import.h"
#include "heba/io/pose_formats.h"
#include "heba/pair_run_types.h"

namespace heba {

// The meaning of the numbers of a robot's pose.
struct PoseReading {
  PoseFormat format;
  bool is_base_from_gripper = true;
};

// The data set, the options of the run, and how the config states them.
struct PairConfig {
  std::filesystem::path file;
  // Without PairDataset::truth, which is read when the run begins. The sources of camera and detections are files.
  PairDataset data;
  PairRunOptions options;
  std::string target_used;  // The target with every default filled in, as YAML.
  // Whether the config itself holds the target in heba's keys, so that a setting target.KEY changes one of them.
  // Otherwise the target is in a file of its own, in an imported data set, or in Kalibr's keys.
  bool has_target_keys = false;
  // Whether the ids of given detections are places in the list of the target's points.
  bool are_points_in_order = false;
  std::filesystem::path poses_file;
  // The number of images (or corners, or poses of the target) counts those with and those without a robot pose.
  size_t num_images = 0;
  std::vector<std::string> images_without_pose;
  std::vector<std::string> poses_without_image;
  PoseReading pose_reading;
  std::vector<std::vector<double>> pose_numbers;  // Per capture, as in the poses file.
  std::optional<ImportedSet> imported;            // The data set of another project that the captures are from.
  std::filesystem::path joints_file;              // The recorded joints; empty if there are none.
  bool joints_are_deg = false;
  // Files that the captures were read from, other than images and poses.
  std::vector<std::filesystem::path> data_files;
  std::optional<std::filesystem::path> truth;
  std::filesystem::path output;
  std::string used;  // The config as used, with every default filled in, as YAML.
};

}  // namespace heba
