// What the benchmarks work on: simulated, the same in every run.
#pragma once

#include <vector>

#include "heba/data/problem.h"
#include "heba/evaluation/metrics.h"
#include "solvers/calibration/calibration.h"
#include "solvers/calibration/study.h"

namespace heba {

// One coordinate's noise in every scene, and the robot's where it has any.
inline constexpr double kBenchNoisePx = 0.1;
inline constexpr RobotNoise kBenchRobot = {1e-4, 3.5e-4};

struct BenchScene {
  Problem problem;
  HandEye truth;
  HandEye start;  // A few millimetres and milliradians off.
};

// A board of points_a_side^2 points before a camera beside the robot.
BenchScene MakeBenchScene(int num_captures, int points_a_side, bool has_robot_noise = false);

// What closed forms get: poses with noise.
std::vector<PosePair> NoisyPairsOf(const BenchScene& scene);

// Every closed form for any motion, and a camera to be found.
CalibrationOptions BenchCalibrationOptions(const BenchScene& scene);

// 15 captures of 4 points, the camera given; a robot's noise is estimated if it has any.
StudyCell MakeBenchStudyCell(bool has_robot_noise);

}  // namespace heba
