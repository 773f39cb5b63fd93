// Simulated captures: robot poses from which a camera sees a target, and what it would measure. Everything follows from
// the seed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/data/problem.h"
#include "heba/data/setup.h"

namespace heba {

// How the target moves before the camera (or the camera before the target).
struct MotionOptions {
  int num_captures = 20;
  double distance_m = 0.6;     // Of the target's middle along the optical axis, on average.
  double depth_ratio = 0.2;    // The distance varies by plus or minus this share.
  double max_tilt_rad = 0.44;  // Of the target's normal against the line of sight; at least 0.3 of it is used.
  double max_spin_rad = 1.05;  // About the normal, plus or minus.
  double spread = 0.5;         // The target's middle falls into this share of the image's width and height.
  double margin_px = 10;       // All points stay this far from the image's edge.

  // Every violated constraint, one a line; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

// The motion of the two-step method (Fang et al. 2021, section 3): a home pose, one translation along the tool's x and
// one along its y, turns about the tool point.
struct TwoStepMotionOptions {
  double translation_m = 0.1;
  int num_turns = 12;
  double max_turn_rad = 0.44;  // About a random axis; at least 0.4 of it is used.

  [[nodiscard]] std::string Check() const;
};

struct SimulatedPose {
  std::string role;  // As in poses.csv.
  Rigid3d camera_from_target;
};

// From a home pose as SimulatePoses would choose it, with the target near the optical axis and facing the camera. The
// tool is the gripper as the robot reports it. A Failure if the target does not stay in the image.
Outcome<std::vector<SimulatedPose>> SimulateTwoStepPoses(Setup setup, const Camera& camera,
                                                         const Points3& points_in_target, bool z_out,
                                                         const HandEye& hand_eye, const MotionOptions& home,
                                                         const TwoStepMotionOptions& options, Rng* rng);

// camera_from_target of each capture, all of `points_in_target` in the image. `z_out`: the target's z axis points out
// of its front side (else into it). A Failure if the target does not fit into the image from such poses.
Outcome<std::vector<Rigid3d>> SimulatePoses(const Camera& camera, const Points3& points_in_target, bool z_out,
                                            const MotionOptions& options, Rng* rng);

// The robot pose that makes the camera see `camera_from_target`.
Rigid3d CameraMountFromTargetMount(const HandEye& hand_eye, const Rigid3d& camera_from_target);

// A pose as a robot with random errors reports it: gripper_from_gripper noise on the right of base_from_gripper, sigma
// per axis.
Rigid3d WithRobotNoise(const Rigid3d& base_from_gripper, double rotation_sigma_rad, double translation_sigma_m,
                       Rng* rng);

// A view of all points with Gaussian noise per coordinate. Nothing if a point has no image.
std::optional<View> SimulateView(const std::string& name, const Camera& camera, const HandEye& hand_eye,
                                 const Rigid3d& camera_mount_from_target_mount, const Points3& points_in_target,
                                 double noise_sigma_px, Rng* rng);

}  // namespace heba
