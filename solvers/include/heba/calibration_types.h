// The options of a calibration, and what comes out.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "heba/adjustment_options.h"
#include "heba/base/error.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/pair_calibration_types.h"
#include "heba/robot_errors.h"

namespace heba {

struct CalibrationOptions {
  AdjustmentOptions adjustment;
  // For each camera, whether ProblemCamera::camera is given. Otherwise its size is, and its model unless that is to be
  // chosen, for which it is empty. An empty list: none is given.
  std::vector<bool> has_camera;
  bool choose_target_shape = true;  // Otherwise ProblemTarget::free_shape holds.
  // Errors of the arms' poses that vary smoothly with the pose. They need an estimated noise of the arms without a
  // prior.
  SmoothPoseErrors smooth = SmoothPoseErrors::kAuto;
  // One for each arm, or an empty list: no arm is known. Errors of an arm need an estimated noise of the arms, too; an
  // arm of which they are estimated has no smooth errors beside them.
  std::vector<ArmErrorModels> arms = {};
  // One sigma of the scale of the arms' translations about 1, the largest of all arms: with it, the captures may
  // contradict what is known about the size of a target.
  double robot_scale_sigma = kRobotScaleSigma;
};

// The calibration of one pair of a camera and a target by itself (CalibratePair).
struct CalibratedPair {
  size_t camera = 0;
  size_t target = 0;
  // The arm that moves one against the other; nothing if none or two do.
  std::optional<size_t> robot;
  int num_images = 0;
  Outcome<PairCalibration> calibration = {};
};

// An image that is not used; all images of the capture if `image` is not set.
struct UnusedProblemImage {
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

struct Calibration {
  // The problem that was solved: its cameras have their initial intrinsics, its targets the free parts of their shape
  // that were chosen, its arms the effects that were chosen, and symmetric targets the reading order that was chosen.
  // Images that are not used have no points.
  Problem problem;
  std::vector<CalibratedPair> pairs;
  std::vector<UnusedProblemImage> unused;
  std::vector<MovedCamera> moved;
  std::vector<ArmErrorChoice> arms;  // One for each arm with models to choose from (CalibrationOptions::arms).
  std::vector<AddedSmoothErrors> smooth_errors;
  Outcome<Solution> refined = {};
};

}  // namespace heba
