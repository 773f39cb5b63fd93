// Simulated captures of a rig: several cameras, targets and arms. Everything is determined by the seed.
#pragma once

#include <vector>

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/data/rig.h"
#include "heba/data/solution.h"
#include "heba/simulation/scene.h"

namespace heba {

// A target as the simulation sees it.
struct SimulatedTarget {
  Points3 points_in_target;
  bool z_out = false;  // Whether the target's z axis points out of its front side.
};

struct RigSceneOptions {
  MotionOptions motion;    // Of each target in front of the camera for which a pose is drawn.
  double noise_px = 0;     // One sigma of each pixel coordinate.
  RobotNoise robot_noise;  // Of every arm's pose; joint_rad is not used.
  // Poses of the arms near which they stand when nothing else determines them: base_from_gripper, one per arm.
  std::vector<Rigid3d> homes;
};

// The exact poses of the arms in one capture.
using ArmPoses = std::vector<Rigid3d>;

// Simulates the poses of the arms. In each capture, every arm that moves a target against a camera is put where one of
// these cameras, drawn at random, sees one of these targets (SimulatePoses); an arm that only meets others stands near
// its home. The other images of the capture follow from these poses. Returns a Failure if a target does not fit into an
// image. `rig` needs no captures.
Outcome<std::vector<ArmPoses>> SimulateArmPoses(const RigProblem& rig, const RigPoses& poses,
                                                const std::vector<SimulatedTarget>& targets,
                                                const RigSceneOptions& options, Rng* rng);

// Returns the pose that an arm with this noise reports: T, where the exact pose is T * Exp(error).
Rigid3d ReportedPose(const Rigid3d& exact, const RobotNoise& noise, Rng* rng);

// Returns whether a camera sees the front of a target with all its points at least `margin_px` from the border.
bool IsVisible(const Camera& camera, const Rigid3d& camera_from_target, const SimulatedTarget& target,
               double margin_px);

// Simulates the captures at these poses of the arms: the poses that the arms report, and the points of every target
// that a camera sees as a whole, with noise.
std::vector<RigCapture> SimulateRigCaptures(const RigProblem& rig, const RigPoses& poses,
                                            const std::vector<SimulatedTarget>& targets,
                                            const std::vector<ArmPoses>& arm_poses, const RigSceneOptions& options,
                                            Rng* rng);

}  // namespace heba
