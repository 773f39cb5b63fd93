// A run's config, read and checked, with the data set that it names.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/data/dataset.h"
#include "heba/data/setup.h"
#include "heba/io/import.h"
#include "heba/io/pose_formats.h"
#include "solvers/calibration/calibration.h"
#include "targets/detection.h"
#include "targets/target.h"

namespace heba {

// The meaning of the numbers of a robot's pose.
struct PoseReading {
  PoseFormat format;
  bool is_base_from_gripper = true;
};

// The accuracy with which a target must be located at given positions (evaluate.require).
struct PlacedRequirement {
  double within_m = 0;
  double confidence = 0.95;
  std::vector<Eigen::Vector3d> places_in_base_m;  // A point, or a box's corners; empty: the working point.
  std::string text;                               // The positions in words.
};

// An image or a row of poses that belongs to no capture.
struct LeftOut {
  std::string name;    // Name of the image, or of the row of poses without one.
  std::string reason;  // One clause.
};

struct RunConfig {
  std::filesystem::path file;
  std::string name;
  std::vector<std::pair<std::string, std::string>> about;  // RunResult::about.
  Setup setup = Setup::kEyeToHand;
  std::shared_ptr<const Target> target;  // Null if poses of the target are given, and the target is not.
  std::string target_used;               // YAML, with every default filled in.
  std::optional<Camera> camera;          // Estimated if not set. Its size is 0 x 0 if its file does not state it.
  std::string camera_model;
  std::string camera_file;  // For messages.
  std::filesystem::path poses_file;
  PoseReading pose_reading;
  std::vector<Capture> captures;
  std::vector<std::vector<double>> pose_numbers;  // Per capture, as in the poses file.
  // Measurements that replace the images, one per capture, or empty.
  std::vector<CaptureDetection> given_detections;
  std::vector<Rigid3d> target_poses;    // camera_from_target.
  std::optional<ImportedSet> imported;  // The data set of another project that the captures are from.
  // Files that the captures were read from, other than images and poses.
  std::vector<std::filesystem::path> data_files;
  std::vector<LeftOut> left_out;
  std::string seed;
  std::vector<std::string> methods;  // Empty: all.
  BundleOptions bundle;
  AutoModel choose;                  // The parts of `bundle` that are chosen from the captures.
  bool choose_camera_model = false;  // Whether camera_model is chosen from the captures.
  int folds = 0;
  std::vector<PlacedRequirement> requirements;
  std::optional<std::filesystem::path> truth;
  std::filesystem::path output;
  std::string used;  // The config as used, with every default filled in, as YAML.
};

// Reads the config, the files that it is based on, and the files that they name, except for the images. `settings`
// (--set) take precedence over the files. Throws InputError on any error.
RunConfig ReadRunConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

// Reads a target from a mapping, or from the file that a path names; `reader` records it for the config as used.
std::shared_ptr<const Target> ReadTarget(MapReader& reader, const std::string& key);
// Reads the key `name`, which must be able to name a folder.
std::string ReadFolderName(MapReader& reader, const std::string& fallback);
// Reads the key `methods`: a list without repetitions, or `all`, the default, which is returned as an empty list.
std::vector<std::string> ReadMethods(MapReader& reader);
// Reads the key `intrinsics`, the groups of free parameters: a list without repetitions.
std::vector<ParameterGroup> ReadFreeIntrinsics(MapReader& reader, const std::vector<ParameterGroup>& fallback);

}  // namespace heba
