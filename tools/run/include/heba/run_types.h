// The data and the options of a run, and what comes out.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/error.h"
#include "heba/calibration_types.h"
#include "heba/detection.h"
#include "heba/evaluation/run_result.h"
#include "heba/pair_run_types.h"
#include "heba/target.h"

namespace heba {

// A recording has what was recorded at one pose of every arm.
struct Recording {
  std::string name;
  std::vector<Rigid3d> base_from_gripper;     // One per arm.
  std::vector<std::filesystem::path> images;  // One per camera; empty if it recorded none.
  // The positions of the joints of each arm, rad or m; an empty list of an arm, or of all: not recorded.
  std::vector<std::vector<double>> joints = {};
};

// Images, or a row of poses, that belong to no capture of the data set.
struct LeftOutImages {
  std::string name;                           // The capture, an image as CAMERA/FILE, or a row as FILE:LINE.
  std::string reason;                         // One clause.
  std::string capture;                        // Empty for an image without a pose of the arms.
  std::vector<std::filesystem::path> images;  // One per camera, empty if it recorded none; or an empty list.
};

// The detection of one target in one image.
struct TargetDetection {
  size_t capture = 0;
  size_t camera = 0;
  size_t target = 0;
  CaptureDetection detection;
};

// The recorded data of any number of cameras, targets and arms.
struct Dataset {
  std::string name;
  std::vector<std::pair<std::string, std::string>> about;  // RunResult::about.
  // Names, mounts, and the cameras that are given. The shapes of targets follow from `targets`.
  Problem rig;
  std::vector<bool> has_camera;             // One per camera: whether it is given.
  std::vector<std::string> camera_sources;  // One per camera: what starts the messages about it.
  std::vector<std::shared_ptr<const Target>> targets;
  std::vector<Recording> captures;
  // Detections that replace the images, whose paths are then names only; or an empty list. A size of 0 x 0 stands for
  // that of the camera.
  std::vector<TargetDetection> given_detections = {};
  std::string detections_source = "detections";  // Messages about them start with it.
  // One per arm: its kinematics, if they are known; or an empty list.
  std::vector<std::optional<RobotArm>> arms = {};
  std::vector<std::optional<double>> robot_scale_sigmas = {};  // PairDataset::robot_scale_sigma of each arm; or empty.
  std::optional<CellTruth> truth;
  std::vector<LeftOutImages> left_out;  // Is listed in the result.
};

struct RunOptions {
  CalibrationOptions calibration;             // Its `has_camera` and `arms` are not used.
  Kinematics kinematics = Kinematics::kAuto;  // Which errors of the arms are estimated, if Dataset::arms has any.
  DriftOptions drift;                         // PairRunOptions::drift, for one camera, one target and one arm.
  std::optional<EarlierRun> earlier = {};
  std::vector<PlacedRequirement> requirements;
  int folds = 5;        // Number of folds of the cross-validation; 0: none.
  int num_threads = 1;  // The result does not depend on it.
  // One per target; replace DetectWithDigest. Empty: none is replaced.
  std::vector<DetectFunction> detect;
};

struct RunOutput {
  RunResult result;  // All figures and findings. `timing.total_s` covers the call of Run.
  // The data set without the captures that were left out (Dataset::left_out, or the entries of `result`).
  Dataset dataset;
  // Every image of `dataset` has one for every target; empty if poses of the target were given.
  std::vector<TargetDetection> detections;
  // Calibration::pairs has the calibration of one camera, one target and one arm. Calibration::refined is a Failure if
  // poses of the target were given.
  Calibration calibration;
};

}  // namespace heba
