// Reads a study's file: scenes, and lists of values to vary. The cells of the study are all combinations.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "solvers/study/study.h"

namespace heba {

// The values that define a cell, for tables and plots.
struct StudyLabels {
  std::string scene;
  Setup setup = Setup::kEyeToHand;
  std::string rig;   // For a rig, which has no setup: "3 cameras, 2 targets, 1 arm".
  std::string pose;  // For a rig, once it was run: the pose whose errors are stated, as StudiedPoses calls it.
  int num_captures = 0;
  int num_points = 0;
  double pixel_sigma_px = 0;
  RobotNoise robot_noise;
  std::array<double, TargetShape::kNumParams> shape_params = TargetShape().params;
  double outlier_points = 0;
  double wrong_captures = 0;
  std::string robot_model;  // The refinement's model of the robot: exact | given | estimated | auto.
  std::string kinematics;   // Which errors of the arm it estimates: none | auto | offsets | geometry; empty: no arm.
  std::vector<ParameterGroup> free_intrinsics;  // What the refinement estimates of the cameras.
};

struct StudyConfig {
  std::string name;
  int num_trials = 0;
  uint64_t seed = 1;
  std::vector<StudyLabels> labels;  // One per cell.
  std::vector<StudyCell> cells;
  std::filesystem::path output;
  // The study as used, as YAML that can be read from any folder. Every default is filled in: `captures` and
  // `give_camera` in the scenes if the study leaves them out.
  std::string used;
};

// Reads a study. Throws InputError on any error, including a scene whose target does not fit into its image.
StudyConfig ReadStudyConfig(const std::filesystem::path& path);

}  // namespace heba
