// A run's config, read and checked, and the data set that it names.
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

// What the numbers of a robot's pose mean.
struct PoseReading {
  PoseFormat format;
  bool is_base_from_gripper = true;
};

// How well a target must be located there (evaluate.require).
struct PlacedRequirement {
  double within_m = 0;
  double confidence = 0.95;
  std::vector<Eigen::Vector3d> places_in_base_m;  // A point, or a box's corners; empty: the working point.
  std::string text;                               // The place in words.
};

// A picture or a row of poses that belongs to no capture.
struct LeftOut {
  std::string name;    // The picture's, or that of the row of poses without one.
  std::string reason;  // In one clause.
};

struct RunConfig {
  std::filesystem::path file;
  std::string name;
  std::vector<std::pair<std::string, std::string>> about;  // RunResult::about.
  Setup setup = Setup::kEyeToHand;
  std::shared_ptr<const Target> target;  // Null if poses of the target are given, and the target is not.
  std::string target_used;               // As YAML, every default filled in.
  std::optional<Camera> camera;          // Nothing: to be estimated. Its size is 0 x 0 if its file does not tell.
  std::string camera_model;
  std::string camera_file;  // For messages.
  std::filesystem::path poses_file;
  PoseReading pose_reading;
  std::vector<Capture> captures;
  std::vector<std::vector<double>> pose_numbers;  // Of each capture, as the poses file has them.
  // What is known of the captures in the place of pictures, one each, or none.
  std::vector<CaptureDetection> given_detections;
  std::vector<Rigid3d> target_poses;              // camera_from_target
  std::optional<ImportedSet> imported;            // The data set of another project that the captures are from.
  std::vector<std::filesystem::path> data_files;  // What the captures were read from, but for pictures and poses.
  std::vector<LeftOut> left_out;
  std::string seed;
  std::vector<std::string> methods;  // Empty: all that the motion suits.
  BundleOptions bundle;
  AutoModel choose;                  // The parts of it that the captures choose.
  bool choose_camera_model = false;  // The same of camera_model.
  int folds = 0;
  std::vector<PlacedRequirement> requirements;
  std::optional<std::filesystem::path> truth;
  std::filesystem::path output;
  std::string used;  // The config as used, every default filled in, as YAML.
};

// Reads the config, the files that it is based on and what they name, the pictures excepted. `settings` (--set) count
// more than the files. InputError on any fault.
RunConfig ReadRunConfig(const std::filesystem::path& path, const std::vector<std::string>& settings = {});

// Reads a target from a mapping, or from the file that a path names; `reader` records it for the config as used.
std::shared_ptr<const Target> ReadTarget(MapReader& reader, const std::string& key);

}  // namespace heba
