// The data and the options of a run, what it tells while it runs, and what comes out.
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "heba/base/error.h"
#include "heba/calibration_types.h"
#include "heba/data/drift.h"
#include "heba/data/joint_prior.h"
#include "heba/data/pose_stream.h"
#include "heba/data/setup.h"
#include "heba/detection.h"
#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/run_result.h"
#include "heba/pair_calibration_types.h"
#include "heba/pair_cross_validation.h"
#include "heba/robot/arm.h"
#include "heba/target.h"

namespace heba {

// A recording has what was recorded at one pose of every arm.
struct Recording {
  std::string name;                           // Identifies the capture in messages and results.
  std::vector<Rigid3d> base_from_gripper;     // One per arm.
  std::vector<std::filesystem::path> images;  // One per camera; empty if it recorded none.
  // The positions of the joints of each arm, rad or m; an empty list of an arm, or of all: not recorded.
  std::vector<std::vector<double>> joints = {};
  CaptureRole role = CaptureRole::kNone;  // The part that it has in the two-step motion.
  std::optional<double> time_s = {};      // When the images were taken, by the camera's clock.
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

// The arm, if its kinematics may be estimated.
struct RobotArm {
  Arm arm;  // The kinematics as the maker, or a calibration, states them.
  // The gripper whose pose the robot reports. It is found from the captures if their joints are recorded.
  Rigid3d tip_from_gripper;
  // If the joints are not recorded: a posture near that of the first capture, rad or m; may be empty.
  Eigen::VectorXd joints_near;
};

// The recorded data of any number of cameras, targets and arms.
struct Dataset {
  std::string name;                                        // Is copied to the result.
  std::vector<std::pair<std::string, std::string>> about;  // RunResult::about.
  // Names, mounts, and the cameras that are given. The model of a camera that is not given is chosen if it is empty,
  // and its size is that of its images. The shapes of targets follow from `targets`. The result of a camera without a
  // name, which must be the only one, has the short form.
  Problem rig;
  std::vector<bool> has_camera;             // One per camera: whether it is given.
  std::vector<std::string> camera_sources;  // One per camera: what starts the messages about it.
  // One per target; null if `target_poses` are given.
  std::vector<std::shared_ptr<const Target>> targets;
  std::vector<Recording> captures;
  // Detections that replace the images, whose paths are then names only; or an empty list. A size of 0 x 0 stands for
  // that of the camera.
  std::vector<TargetDetection> given_detections = {};
  std::string detections_source = "detections";  // Messages about them start with it.
  // camera_from_target of each capture, which others estimated, in place of images and detections; or an empty list.
  // There must be one camera, one target and one arm.
  std::vector<Rigid3d> target_poses = {};
  // The recorded motion of the robot, from which the poses of the captures are taken
  // (RunOptions::estimates_time_offset). Every
  // capture has a time then, and there must be one arm.
  std::optional<PoseStream> stream = {};
  // One per arm: its kinematics, which are estimated if the captures require it, if they are known; or an empty list.
  std::vector<std::optional<RobotArm>> arms = {};
  // One per arm: one sigma of the scale of its translations; nothing: that of robots (heba/data/scale_sigmas.h). Or an
  // empty list.
  std::vector<std::optional<double>> robot_scale_sigmas = {};
  std::optional<CellTruth> truth;       // The exact result, if it is known.
  std::vector<LeftOutImages> left_out;  // Is listed in the result.
};

// The accuracy with which a target must be located at given positions.
struct PlacedRequirement {
  double within_m = 0;
  double confidence = 0.95;
  std::vector<Eigen::Vector3d> places_in_base_m;  // A point, or a box's corners; empty: the working point.
  std::string text;                               // The positions in words.
  std::string camera = {};                        // The camera that must reach it; empty if every camera must.
};

// An earlier run of the same cell, whose result counts as an observation.
struct EarlierRun {
  std::string name;  // The run has this name in messages.
  std::shared_ptr<const RunResult> result;
  ChangeOfCell change;  // The cell may have changed since.
};

// Returns the detection in an image. Throws InputError if the image cannot be read or is of another size than
// `expected`. It is called by several threads at once.
using DetectFunction =
    std::function<CaptureDetection(const std::filesystem::path& image, const std::optional<ImageSize>& expected)>;

// Which errors of an arm are estimated: none, those that the captures require, or given ones.
// kGravity needs the masses of the arm's links (Arm::load).
enum class Kinematics { kNone, kAuto, kOffsets, kGeometry, kGravity };
inline constexpr std::array<std::string_view, 5> kKinematicsNames = {"none", "auto", "offsets", "geometry", "gravity"};

struct RunOptions {
  CalibrationOptions calibration;             // Its `has_camera` and `arms` are not used.
  Kinematics kinematics = Kinematics::kAuto;  // Which errors of the arms are estimated, if Dataset::arms has any.
  // Whether the time by which the camera's clock is behind that of Dataset::stream is estimated. The poses of the
  // captures stay as they are otherwise.
  bool estimates_time_offset = true;
  DriftOptions drift;  // Which motions of the mounts during the captures are taken in.
  std::optional<EarlierRun> earlier = {};
  std::vector<PlacedRequirement> requirements;
  int folds = 5;        // Number of folds of the cross-validation; 0: none.
  int num_threads = 1;  // The result does not depend on it.
  // One per target; replace DetectWithDigest, for example by functions that keep detections. Empty: none is replaced.
  std::vector<DetectFunction> detect;
  // The rest is for one camera, one target and one arm. The closed forms that are reported, by name; empty: all.
  std::vector<std::string> methods = {};
  std::string seed = kBestSeed;  // See PairCalibrationOptions::seed.
  bool joint_noise = false;      // Whether the robot noise that is estimated includes that of the arm's joints.
};

// The stages of a run whose steps are counted.
enum class RunStage { kDetection, kSecondDetection, kHoldOut };
inline constexpr std::array<const char*, 3> kRunStageNames = {"detection", "second detection", "hold-out"};

// Is told what a run does. Its functions are called by one thread at a time. Those with figures are called for one
// camera, one target and one arm.
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  // A stage begins, a step of it has been completed, and it has ended.
  virtual void OnStage(RunStage /*stage*/, int /*num_steps*/) {}
  virtual void OnStep(RunStage /*stage*/) {}
  virtual void OnStageEnd(RunStage /*stage*/) {}
  // The images have been searched: the target was detected in `num_seen` of `num_images`, not counting those that
  // `notes`, one sentence for each cause, leave out.
  virtual void OnDetected(const std::vector<std::string>& /*notes*/, int /*num_seen*/, int /*num_images*/) {}
  // The calibration has ended, with or without a refined estimate.
  virtual void OnCalibrated(const PairCalibration& /*calibration*/) {}
  virtual void OnHoldOuts(const std::vector<HoldOut>& /*hold_outs*/) {}
  // Returns whether the run is to end. It is asked before each stage and each step; a calibration that has begun is
  // completed first.
  virtual bool IsCancelled() { return false; }
};

// The code of the Failure of a run that was cancelled.
inline constexpr const char* kCancelled = "cancelled";

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
