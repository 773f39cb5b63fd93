// Simulated captures of any number of cameras, targets and arms: poses from which a camera sees a target, and the
// pixels that it measures. Everything is determined by the seed.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/data/pair_problem.h"
#include "heba/data/pair_solution.h"
#include "heba/data/problem.h"
#include "heba/data/setup.h"

namespace heba {

// The motion of the target in front of the camera (or of the camera in front of the target).
struct MotionOptions {
  int num_captures = 20;
  double distance_m = 0.6;   // Mean depth of the target's middle along the optical axis.
  double depth_ratio = 0.2;  // Relative variation of the depth, plus or minus.
  // Largest angle between the target's normal and the line of sight; tilts are at least 0.3 of it.
  double max_tilt_rad = 0.44;
  double max_spin_rad = 1.05;  // Largest rotation about the normal, plus or minus.
  double spread = 0.5;         // Share of the image's width and height in which the target's middle lies.
  double margin_px = 10;       // Smallest distance of all points from the image border.

  // Returns the violated constraints, separated by semicolons; empty if the options are valid.
  [[nodiscard]] std::string Check() const;
};

// The motion of the two-step method (Fang et al. 2021, section 3): a home pose, one translation along the tool's x axis
// and one along its y axis, and rotations about the tool centre point.
struct TwoStepMotionOptions {
  double translation_m = 0.1;
  int num_turns = 12;
  double max_turn_rad = 0.44;  // Largest angle about a random axis; angles are at least 0.4 of it.

  [[nodiscard]] std::string Check() const;
};

// Returns whether all points are in the image, at least `margin_px` from its border.
bool AreInImage(const Camera& camera, const Rigid3d& camera_from_target, const Points3& points_in_target,
                double margin_px);

struct SimulatedPose {
  CaptureRole role = CaptureRole::kNone;
  Rigid3d camera_from_target;
};

// Simulates the captures of the two-step method. The home pose is chosen as by SimulatePoses, with the target near the
// optical axis and facing the camera. The tool is the gripper as the robot reports it. Returns a Failure if the target
// does not stay in the image.
Outcome<std::vector<SimulatedPose>> SimulateTwoStepPoses(Setup setup, const Camera& camera,
                                                         const Points3& points_in_target, bool z_out,
                                                         const HandEye& hand_eye, const MotionOptions& home,
                                                         const TwoStepMotionOptions& options, Rng& rng);

// Returns camera_from_target of each capture, with all of `points_in_target` in the image. `z_out` is true if the
// target's z axis points out of its front side, false if it points into it. Returns a Failure if the target does not
// fit into the image from such poses.
Outcome<std::vector<Rigid3d>> SimulatePoses(const Camera& camera, const Points3& points_in_target, bool z_out,
                                            const MotionOptions& options, Rng& rng);

// Returns the robot pose from which the camera sees `camera_from_target`.
Rigid3d CameraMountFromTargetMount(const HandEye& hand_eye, const Rigid3d& camera_from_target);

// Returns the pose that a robot with random errors reports: gripper_from_gripper noise on the right of
// base_from_gripper, with the given sigmas per axis.
Rigid3d WithRobotNoise(const Rigid3d& base_from_gripper, double rotation_sigma_rad, double translation_sigma_m,
                       Rng& rng);

// Simulates a view of all points with Gaussian noise in each coordinate. Returns nothing if a point has no image.
std::optional<View> SimulateView(const std::string& name, const Camera& camera, const HandEye& hand_eye,
                                 const Rigid3d& camera_mount_from_target_mount, const Points3& points_in_target,
                                 double noise_sigma_px, Rng& rng);

// A target as the simulation sees it.
struct SimulatedTarget {
  Points3 points_in_target;
  bool z_out = false;  // Whether the target's z axis points out of its front side.
};

struct SceneOptions {
  // A pose is drawn for one camera; `motion` places each target in front of it.
  MotionOptions motion;
  double noise_px = 0;     // One sigma of each pixel coordinate.
  RobotNoise robot_noise;  // Every arm's poses have this noise; joint_rad is not used.
  // Poses of the arms near which they stand when nothing else determines them: base_from_gripper, one per arm.
  std::vector<Rigid3d> homes;
};

// The exact poses of the arms in one capture.
using ArmPoses = std::vector<Rigid3d>;

// Simulates the poses of the arms. In each capture, every arm that moves a target against a camera is put where one of
// these cameras, drawn at random, sees one of these targets (SimulatePoses); an arm that only meets others stands near
// its home. The other images of the capture follow from these poses. Returns a Failure if a target does not fit into an
// image. `rig` needs no captures.
Outcome<std::vector<ArmPoses>> SimulateArmPoses(const Problem& rig, const CellPoses& poses,
                                                const std::vector<SimulatedTarget>& targets,
                                                const SceneOptions& options, Rng& rng);

// Returns the pose that an arm with this noise reports: T, where the exact pose is T * Exp(error).
Rigid3d ReportedPose(const Rigid3d& exact, const RobotNoise& noise, Rng& rng);

// Returns whether a camera sees the front of a target with all its points at least `margin_px` from the border.
bool IsVisible(const Camera& camera, const Rigid3d& camera_from_target, const SimulatedTarget& target,
               double margin_px);

// Simulates the captures at these poses of the arms: the poses that the arms report, and the points of every target
// that a camera sees as a whole, with noise.
std::vector<ProblemCapture> SimulateCaptures(const Problem& rig, const CellPoses& poses,
                                             const std::vector<SimulatedTarget>& targets,
                                             const std::vector<ArmPoses>& arm_poses, const SceneOptions& options,
                                             Rng& rng);

}  // namespace heba
