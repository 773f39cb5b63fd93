// Runs the whole calibration of a rig, from images to a refined result: cameras (if they are not given), a calibration
// of every pair of a camera and a target, their joint start, outliers, adjustment.
//
//   const heba::Outcome<heba::RigCalibration> calibration = heba::CalibrateRig(problem, heba::RigCalibrationOptions());
//   if (calibration && calibration->refined) Use(calibration->refined->poses, calibration->refined->covariance);
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/calibration.h"
#include "heba/data/rig.h"
#include "heba/data/rig_solution.h"
#include "heba/data/smooth_errors.h"
#include "heba/rig_adjustment.h"

namespace heba {

struct RigCalibrationOptions {
  RigOptions adjustment;
  // For each camera, whether RigCamera::camera is given. Otherwise its size is, and its model unless that is to be
  // chosen, for which it is empty. An empty list: none is given.
  std::vector<bool> has_camera;
  bool choose_target_shape = true;  // Otherwise RigTarget::free_shape holds.
  // Errors of the arms' poses that vary smoothly with the pose. They need an estimated noise of the arms without a
  // prior.
  SmoothPoseErrors smooth = SmoothPoseErrors::kAuto;
  // One for each arm, or an empty list: no arm is known. Errors of an arm need an estimated noise of the arms, too; an
  // arm of which they are estimated has no smooth errors beside them.
  std::vector<RigArmErrors> arms = {};
};

// The calibration of one pair of a camera and a target by itself, as of a single camera.
struct RigPair {
  size_t camera = 0;
  size_t target = 0;
  // The arm that moves one against the other; nothing if none or two do.
  std::optional<size_t> robot;
  int num_images = 0;
  Outcome<Calibration> calibration = Failure{"not run"};
};

// An image that is not used; all images of the capture if `image` is not set.
struct UnusedRigImage {
  size_t capture = 0;
  std::optional<size_t> image;
  std::string reason;  // One clause.
};

// A camera that was moved on its mount during the captures. The images of the shorter part, before or after the motion,
// are not used.
struct MovedCamera {
  size_t camera = 0;
  size_t last_capture = 0;            // The last capture before the motion that has an image of the camera.
  size_t first_capture = 0;           // The first one after it.
  Rigid3d before_from_after;          // The pose of the camera after the motion, in its pose before it.
  std::vector<size_t> left_out = {};  // The captures whose images of the camera are not used, in their order.
};

struct RigCalibration {
  // The problem that was solved: its cameras have their initial intrinsics, its targets the free parts of their shape
  // that were chosen, its arms the effects that were chosen, and symmetric targets the reading order that was chosen.
  // Images that are not used have no points.
  RigProblem problem;
  std::vector<RigPair> pairs;
  std::vector<UnusedRigImage> unused;
  std::vector<MovedCamera> moved;
  std::vector<RigArmChoice> arms;  // One for each arm with models to choose from (RigCalibrationOptions::arms).
  std::vector<RigSmoothErrors> smooth_errors;
  RigPoses start;
  Outcome<RigSolution> refined = Failure{"not run"};
};

// Calibrates a rig. A pair that one arm moves is calibrated by itself first (Calibrate); the results are joined over a
// spanning tree of the best determined ones, together with pairs that nothing moves. Images that contradict the others,
// and captures of which the pose of an arm does, are listed in `unused` and not used, unless the loss is `none`.
//
// Returns a Failure, in words, if a camera cannot be estimated, if all images of a camera belong to other captures, or
// if a camera, target or arm is not joined to the others by any image. The Failure of the adjustment is in
// RigCalibration::refined.
Outcome<RigCalibration> CalibrateRig(const RigProblem& problem, const RigCalibrationOptions& options);

// Returns a finding `held_intrinsics`, and the change of the estimate, for each camera whose intrinsics were held and
// contradict the images and the poses of the arms, by a joint F-test of their changes in an adjustment that frees them,
// with all images of the camera: wrong intrinsics make images outliers. Cameras that no arm moves against a target, and
// those whose intrinsics cannot be freed, have none. `problem` is the one that was calibrated.
Advice DiagnoseHeldIntrinsics(const RigProblem& problem, const RigCalibration& calibration, const RigOptions& options);

// Returns the findings about a calibration whose adjustment succeeded: targets whose size differs from the design,
// cameras that were moved during the captures, and arms whose poses have smooth errors. `problem` is the one that was
// calibrated.
std::vector<Finding> DiagnoseRig(const RigProblem& problem, const RigCalibration& calibration);

// Returns a finding `weak_direction` for each camera of a calibration whose adjustment succeeded. It has a part
// `weak_direction_of` for each direction of the camera's pose or intrinsics whose sigma exceeds what a robot cell
// usually needs, as for a single camera; if there is none, the finding is good and has the direction that comes next.
// The part `suggested_captures` has the two captures that reduce the sigma of the first direction most, unless none
// reduce it much. The candidates are the motions that are tried for a single camera, of every target in every camera
// that an arm moves, starting from a few of the captures; they count with everything that all cameras would see there.
std::vector<Finding> DiagnoseRigDirections(const RigCalibration& calibration);

}  // namespace heba
