// The simulated workloads of the benchmarks, identical in every run.
#pragma once

#include <vector>

#include "heba/data/pair_problem.h"
#include "heba/data/problem.h"
#include "heba/evaluation/metrics.h"
#include "heba/pair_calibration.h"
#include "solvers/study/study.h"

namespace heba {

// One sigma of the noise of a pixel coordinate in every scene, and of the robot noise in scenes that have it.
inline constexpr double kBenchNoisePx = 0.1;
inline constexpr RobotNoise kBenchRobot = {1e-4, 3.5e-4};

struct BenchScene {
  PairProblem problem;
  HandEye truth;
  HandEye start;  // Differs from the truth by a few millimetres and milliradians.
};

// Makes a scene with a board of points_a_side^2 points in front of a camera beside the robot.
BenchScene MakeBenchScene(int num_captures, int points_a_side, bool has_robot_noise = false);

// A rig of fixed cameras around a target on the gripper, seen by all cameras in most captures.
struct BenchCell {
  Problem problem;
  CellPoses start;  // Differs from the truth by a few millimetres and milliradians.
  int num_observations = 0;
};
BenchCell MakeBenchCell(int num_cameras, int num_captures, int points_a_side);

// Returns the scene with the errors of an arm of six joints as effects of every view, and with noisy joints. Both are
// zero in truth.
BenchScene WithArmEffects(BenchScene scene);

// Returns the input of the closed forms: pose pairs with noise.
std::vector<PosePair> NoisyPairsOf(const BenchScene& scene);

// Returns options with every closed form that accepts any motion, and with a camera to be estimated.
PairCalibrationOptions BenchCalibrationOptions(const BenchScene& scene);

// Makes a cell of 15 captures of 4 points with a given camera. If the robot has noise, it is estimated.
StudyCell MakeBenchStudyCell(bool has_robot_noise);

}  // namespace heba
