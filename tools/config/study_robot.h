// Prepares the cells of a study whose scene has an arm with errors.
#pragma once

#include "solvers/study/study_cell.h"
#include "tools/config/scene_config.h"

namespace heba {

// The captures of a cell, and its robot if the scene has an arm.
struct CapturesOfCell {
  std::vector<StudyCapture> captures;
  std::optional<StudyRobot> robot;
};

// Draws the captures of a scene with an arm, and its robot: with places for the predictions, in the configuration of a
// capture and, if all captures are in one, in others that reach the same poses. Returns a Failure if the arm does not
// reach enough of the poses.
Outcome<CapturesOfCell> DrawArmCaptures(const SceneConfig& scene, Rng& rng);

}  // namespace heba
