// Prepares the cells of a study whose scene has an arm with errors.
#pragma once

#include "solvers/study/study_cell.h"
#include "tools/config/scene_config.h"

namespace heba {

// Sets the captures and the robot of a cell from a scene with an arm: its captures, and places for the predictions, in
// the configuration of a capture and, if all captures are in one, in others that reach the same poses. Returns a
// Failure if the arm does not reach enough of the poses.
std::optional<Failure> SetUpStudyRobot(const SceneConfig& scene, Rng& rng, StudyCell* cell);

}  // namespace heba
