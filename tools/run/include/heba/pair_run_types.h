// The data and the options of a run of one camera, one target and one arm, what it tells while it runs, and what comes
// out.
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
#include "heba/data/dataset.h"
#include "heba/data/drift.h"
#include "heba/data/joint_prior.h"
#include "heba/data/setup.h"
#include "heba/detection.h"
#include "heba/evaluation/evaluation.h"
#include "heba/evaluation/run_result.h"
#include "heba/pair_calibration.h"
#include "heba/pair_cross_validation.h"
#include "heba/robot/arm.h"
#include "heba/target.h"

namespace heba {

// An image or a row of poses that belongs to no capture.
struct LeftOut {
  std::string name;    // Name of the image, or of the row of poses without one.
  std::string reason;  // One clause.
};

// The arm, if its kinematics may be estimated.
struct RobotArm {
  Arm arm;  // The kinematics as the maker, or a calibration, states them.
  // The gripper whose pose the robot reports. It is found from the captures if their joints are recorded.
  Rigid3d tip_from_gripper;
  // If the joints are not recorded: a posture near that of the first capture, rad or m; may be empty.
  Eigen::VectorXd joints_near;
};

// The recorded data. Each capture has an image, or a detection that was made before, or a pose of the target that
// others estimated.
struct PairDataset {
  std::string name;                                        // Is copied to the result.
  std::vector<std::pair<std::string, std::string>> about;  // RunResult::about.
  Setup setup = Setup::kEyeToHand;
  std::shared_ptr<const Target> target;  // May be null if `target_poses` are given.
  // Is estimated from the captures if it is not set. A size of 0 x 0 stands for that of the images.
  std::optional<Camera> camera;
  std::vector<Capture> captures;
  // Detections that replace the images: one per capture, or empty. A size of 0 x 0 stands for that of the camera.
  std::vector<CaptureDetection> given_detections;
  // One sigma of the scale of the robot's translations; nothing: that of robots (heba/data/scale_sigmas.h).
  std::optional<double> robot_scale_sigma = {};
  std::optional<RobotArm>
      robot;  // Its kinematics are estimated if the captures require it (PairRunOptions::kinematics).
  // camera_from_target of each capture, instead of images and detections; or empty.
  std::vector<Rigid3d> target_poses;
  std::optional<Truth> truth;     // The exact result, if it is known.
  std::vector<LeftOut> left_out;  // Is listed in the result.
  // The sources of the camera and of the given detections, which start the messages of an InputError.
  std::string camera_source = "camera";
  std::string detections_source = "detections";
};

// The accuracy with which a target must be located at given positions.
struct PlacedRequirement {
  double within_m = 0;
  double confidence = 0.95;
  std::vector<Eigen::Vector3d> places_in_base_m;  // A point, or a box's corners; empty: the working point.
  std::string text;                               // The positions in words.
  std::string camera = {};  // In a rig, the camera that must reach it; empty if every camera must.
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

struct PairRunOptions {
  std::vector<std::string> methods;  // Closed forms to report, by name; empty: all.
  std::string seed = kBestSeed;      // See PairCalibrationOptions::seed.
  BundleOptions bundle;
  AutoModel choose = {true, true};            // The parts of `bundle` that are chosen from the captures.
  Kinematics kinematics = Kinematics::kAuto;  // Not used without PairDataset::robot.
  bool joint_noise = false;  // Whether the robot noise that is estimated includes that of the arm's joints.
  SmoothPoseErrors smooth = SmoothPoseErrors::kAuto;
  DriftOptions drift;  // Which motions of the mounts during the captures are taken in.
  std::optional<EarlierRun> earlier = {};
  std::string camera_model;         // The model of an estimated camera.
  bool choose_camera_model = true;  // Whether that model is chosen from the captures instead.
  int folds = 5;                    // Number of folds of the cross-validation; 0: none.
  std::vector<PlacedRequirement> requirements;
  int num_threads = 1;  // The result does not depend on it.
  // Replaces DetectWithDigest, for example by a function that keeps detections.
  DetectFunction detect;
};

// The stages of a run whose steps are counted.
enum class RunStage { kDetection, kSecondDetection, kHoldOut };
inline constexpr std::array<const char*, 3> kRunStageNames = {"detection", "second detection", "hold-out"};

// Captures that are not used because their image is that of another capture (tools/run/duplicate_images.h).
struct LeftOutCaptures {
  std::vector<size_t> indices;       // Sorted in increasing order.
  std::vector<ImageResult> results;  // Marked as not used, with the reason.
  std::vector<std::string> notes;    // One sentence for each cause.
};

// Is told what a run does. Its functions are called by one thread at a time.
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  // A stage begins, a step of it has been completed, and it has ended.
  virtual void OnStage(RunStage /*stage*/, int /*num_steps*/) {}
  virtual void OnStep(RunStage /*stage*/) {}
  virtual void OnStageEnd(RunStage /*stage*/) {}
  // The images have been searched: the target was detected in `num_seen` of `num_images`, not counting those left out.
  virtual void OnDetected(const LeftOutCaptures& /*left_out*/, int /*num_seen*/, int /*num_images*/) {}
  // The calibration has ended, with or without a refined estimate.
  virtual void OnCalibrated(const PairCalibration& /*calibration*/) {}
  virtual void OnHoldOuts(const std::vector<HoldOut>& /*hold_outs*/) {}
  // Returns whether the run is to end. It is asked before each stage and each step; a calibration that has begun is
  // completed first.
  virtual bool IsCancelled() { return false; }
};

// The code of the Failure of a run that was cancelled.
inline constexpr const char* kCancelled = "cancelled";

}  // namespace heba
