// Simulated motion of arms, whose kinematics may have errors.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/base/error.h"
#include "heba/base/rng.h"
#include "heba/data/problem.h"
#include "heba/robot/arm.h"
#include "heba/simulation/scene.h"

namespace heba {

// An arm whose kinematics are not those that its controller assumes.
struct SimulatedArm {
  Arm nominal;
  Eigen::VectorXd errors;  // One per parameter.
  Rigid3d tip_from_gripper;
  // Whether captures are taken in any configuration of the arm, or all in that of the first one.
  bool has_several_configurations = true;
  double joint_noise_rad = 0;  // One sigma of each joint in each capture.
};

// An arm that is commanded to a pose reaches another one.
struct Reached {
  Eigen::VectorXd joints;  // Commanded, rad or m.
  Rigid3d exact;           // The pose of the gripper (base_from_gripper).
  Rigid3d stated;          // The pose that a controller without noise reports.
};
// Commands an arm to a pose of its gripper, in a posture that reaches it with the kinematics `of_posture`: the nominal
// ones, so that the gripper stands near the pose, or the true ones. Returns nothing if there is no such posture
// (DrawPosture, with `near`).
std::optional<Reached> Reach(const SimulatedArm& arm, const Arm& of_posture, const Rigid3d& base_from_gripper,
                             const std::optional<Eigen::VectorXd>& near, Rng& rng);

// The motion of the arms, with one entry per capture.
struct ArmMotion {
  std::vector<ArmPoses> exact;
  std::vector<ArmPoses> stated;  // The poses that controllers without noise report.
  // The commanded joints of each arm (rad or m); empty for an arm that is exact.
  std::vector<std::vector<Eigen::VectorXd>> joints;
};
// Simulates the motion of arms, of which those in `arms` (one per arm) have errors: in each capture, they are commanded
// near a pose of SimulateArmPoses that they reach. Returns a Failure if they reach too few of them.
Outcome<ArmMotion> SimulateArmMotion(const Problem& rig, const CellPoses& poses,
                                     const std::vector<SimulatedTarget>& targets, const SceneOptions& options,
                                     const std::vector<std::optional<SimulatedArm>>& arms, Rng& rng);

// Simulates the captures of a motion (SimulateCaptures of heba/simulation/scene.h): the poses that the arms
// report are the stated ones with noise.
std::vector<ProblemCapture> SimulateCaptures(const Problem& rig, const CellPoses& poses,
                                             const std::vector<SimulatedTarget>& targets, const ArmMotion& motion,
                                             const SceneOptions& options, Rng& rng);

}  // namespace heba
