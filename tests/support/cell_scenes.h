// Simulated rigs for tests, determined by a seed.
#pragma once

#include <string>
#include <vector>

#include "heba/base/units.h"
#include "heba/data/problem.h"
#include "heba/data/smooth_errors.h"
#include "heba/simulation/scene.h"
#include "tests/support/scenes.h"

namespace heba {

struct CellScene {
  Problem problem;
  CellPoses truth;
  std::vector<SimulatedTarget> targets;
  std::vector<ArmPoses> arms;  // The exact poses.
};

struct CellSceneSetting {
  int num_captures = 25;
  double noise_px = 0.1;
  RobotNoise robot_noise = {0.1e-3, DegToRad(0.02), 0};
  bool has_free_intrinsics = true;
};

const std::vector<ParameterGroup>& AllIntrinsics();

// The errors of poses, summed over trials.
struct PoseErrorSums {
  double chi2 = 0;
  double squares_m2 = 0;
  int num_poses = 0;

  void Add(const Rigid3d& pose, const Rigid3d& truth, const Eigen::Matrix<double, 6, 6>& covariance);
};

// Returns the pose of a camera at `place` that looks at `middle`.
Rigid3d LookingAt(const Eigen::Vector3d& place, const Eigen::Vector3d& middle, double spin_rad);

void AddCamera(const std::string& name, const Mount& mount, const Rigid3d& mount_from_camera,
               const CellSceneSetting& setting, CellScene* scene);

void AddTarget(const std::string& name, const Mount& mount, const Rigid3d& mount_from_target, CellScene* scene);

// Returns the options of the simulation of a rig with this number of arms.
SceneOptions OptionsOf(const CellSceneSetting& setting, size_t num_arms);

void Simulate(const CellSceneSetting& setting, Rng& rng, CellScene* scene);

// Returns a scene of one arm, whose base is the world, without anything else.
CellScene OneArmScene();

// Adds the fixed cameras left and right, which look at the place where the arm works.
void AddLeftAndRight(const CellSceneSetting& setting, Rng& rng, CellScene* scene);

// Draws errors of each arm that vary smoothly with the pose, and makes them part of the poses that it reports.
void AddSmoothErrors(const RobotNoise& sigma, const SmoothLengths& lengths, uint64_t seed, CellScene* scene);

// Two fixed cameras and one on the gripper, a target on the gripper and one beside the arm.
CellScene MixedCell(uint64_t seed, const CellSceneSetting& setting = {});

// Four fixed cameras around a target on the gripper.
CellScene FourCameraCell(uint64_t seed, const CellSceneSetting& setting = {});

// One fixed camera that sees a target on each of two arms.
CellScene TwoArmCell(uint64_t seed, const CellSceneSetting& setting = {});

}  // namespace heba
