// Plans the poses of a session: those that make the least uncertain what the calibration is for, a located target.
//
//   heba::PlanCell cell;
//   cell.setup = heba::Setup::kEyeInHand;
//   cell.camera = camera;                      // Rough, too.
//   cell.hand_eye = {gripper_from_camera, base_from_target};
//   cell.points_in_target = points;
//   cell.workspace = heba::PlanBox{{0.2, -0.4, 0.1}, {0.8, 0.4, 0.7}};
//   const heba::Outcome<heba::CapturePlan> plan = heba::PlanCaptures(cell, {});
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/camera/camera.h"
#include "heba/camera/camera_model.h"
#include "heba/data/capture_role.h"
#include "heba/data/pair_problem.h"
#include "heba/data/pair_solution.h"
#include "heba/data/setup.h"

namespace heba {

// A box along the axes of the robot's base, m.
struct PlanBox {
  Eigen::Vector3d low_m;
  Eigen::Vector3d high_m;

  bool Contains(const Eigen::Vector3d& point_m) const {
    return (point_m.array() >= low_m.array()).all() && (point_m.array() <= high_m.array()).all();
  }
};

// A posture of an arm that reaches a pose.
struct PlanPosture {
  Eigen::VectorXd joints;  // rad or m.
  // A name that postures have in common if no singularity is between them; empty if the arm's have none.
  std::string configuration = {};
};

// A PlanCell holds what is known about a cell, be it by a tape measure or by a finished run.
struct PlanCell {
  Setup setup = Setup::kEyeToHand;
  Camera camera;
  std::vector<ParameterGroup> free_intrinsics = {};
  // The covariance of the poses (`hand_eye`, `board`) and of the free intrinsics before the session. What it lacks is
  // unknown: 30 mm and 5 deg, and a tenth of a parameter of the camera.
  Covariance known = {};
  HandEye hand_eye;
  // The size of the error of each of the two poses, against which every planned pose is safe.
  double uncertainty_m = 0.03;
  double uncertainty_rad = DegToRad(5);
  Points3 points_in_target;
  bool z_out = false;  // Whether the target's z axis points out of its front side.
  double pixel_noise_px = 0.2;
  RobotNoise robot_noise = {1e-3, DegToRad(0.1)};
  std::optional<PlanBox> workspace = {};  // The gripper stays in it.
  std::vector<PlanBox> keep_out = {};     // The gripper and what it carries stay out of them.
  double clearance_m = 0.1;               // The least distance of the gripper and what it carries from a fixed camera.
  double max_tilt_rad = DegToRad(45);     // Between the target's normal and the line of sight.
  double nearest_m = 0;                   // The depth of field; 0 and infinity: that in which the target is seen well.
  double farthest_m = std::numeric_limits<double>::infinity();
  // Targets will be located at these places, in the base; empty: where the camera sees the target in the planned
  // poses. A camera on the gripper sees a target at any position as there.
  std::vector<Eigen::Vector3d> places_in_base_m = {};
  // The poses of an earlier session: its first ones are taken once more at the end, in place of the first planned ones.
  std::vector<Rigid3d> former_poses = {};
  // Returns the postures in which the arm reaches a pose of the gripper, an empty list if it does not. Not set: every
  // pose is reached.
  std::function<std::vector<PlanPosture>(const Rigid3d& base_from_gripper)> postures = nullptr;
  // Returns the pose next to a wanted one that an arm of fewer than six joints reaches. Not set: the wanted one.
  std::function<Rigid3d(const Rigid3d& base_from_gripper)> nearest_reached = nullptr;
  // Returns how far apart two of them are; needed with `postures`.
  std::function<double(const Eigen::VectorXd& a, const Eigen::VectorXd& b)> posture_distance = nullptr;
};

struct PlanOptions {
  int count = 15;        // At least 5 with is_two_step.
  int num_revisits = 3;  // The first poses that are taken once more at the end, which shows a drift (drift_search.h).
  uint64_t seed = 1;
  // The motions of the two-step method instead of the best poses: a home pose, two translations, and turns.
  bool is_two_step = false;
  int num_candidates = 3000;
};

struct PlannedCapture {
  Rigid3d base_from_gripper;
  CaptureRole role = CaptureRole::kNone;
  PlanPosture posture = {};  // Without joints if there is no arm.
  // The planned capture that this one takes once more or, if there are any, the index in PlanCell::former_poses.
  std::optional<size_t> repeats = {};
  Rigid3d camera_from_target;
  double visible_share = 1;  // The share of rough set-ups in which the camera sees the whole target.
  // The errors below are expected after this capture, one sigma by the calibration alone: that of a located target
  // (the root of the sum of its three variances, root mean square over the places), and that of the camera's pose
  // likewise. A repeated pose is taken to add nothing.
  double target_m = 0;
  double position_m = 0;
  double orientation_rad = 0;
};

// A direction of the camera's pose of which the planned captures tell little: more than half of the sigma before them
// stays, and more than 5 mm or 1 deg. Arms of few joints leave some.
struct UntoldDirection {
  Eigen::Vector3d in_mount;  // The direction or axis, in the frame of what the camera is mounted on.
  bool is_rotation = false;
  double sigma = 0;  // m or rad.
};

struct CapturePlan {
  std::vector<PlannedCapture> captures;
  std::vector<UntoldDirection> untold;  // At most one of the position and one of the orientation.
  double target_before_m = 0;           // PlannedCapture::target_m before the session.
  size_t num_candidates = 0;            // The poses from which was chosen.
  double order_by_pose = 0;             // OrderByPose of the captures: a drift is seen below .3.
};

// Returns the plan: candidates are drawn over the image, the depths, tilts and spins; those outside of the workspace,
// out of reach, or from which the camera misses a part of the target in more than 3 % of 200 rough set-ups are dropped,
// so that it misses one in fewer than 5 % of others; from the rest, poses are chosen one after the other, and then
// exchanged, so that the mean over the places of the variance of a located target is least (A-optimal; Fedorov, "Theory
// of Optimal Experiments", 1972) or, with free intrinsics, that of the logarithm of the determinant of its covariance
// (D-optimal). Each capture counts with the information about the unknowns that the noise of the robot leaves it.
// Returns a Failure that says what most candidates fail at if there are fewer than `count`.
//
// The captures begin in the configuration in which the arm has the least to turn. From ten on, the second half is in
// the configuration that is the farthest from it and reaches nine in ten of the captures: errors of an arm that are
// alike in one configuration look like another pose of the camera. Captures that repeat the first ones have their
// postures. The two-step motion has one configuration.
Outcome<CapturePlan> PlanCaptures(const PlanCell& cell, const PlanOptions& options);

}  // namespace heba
