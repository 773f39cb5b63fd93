// Cells of studies of simulated rigs for tests.
#pragma once

#include "solvers/rig/rig_study.h"
#include "tests/support/rig_scenes.h"

namespace heba {

// Returns a study's cell of the scene, whose calibration starts from the true cameras and takes the targets as
// designed.
inline RigStudyCell CellOf(const RigScene& scene, const RigSceneSetting& setting = {}) {
  RigStudyCell cell;
  cell.rig = scene.problem;
  cell.rig.captures.clear();
  cell.poses = scene.truth;
  cell.targets = scene.targets;
  cell.arms = scene.arms;
  cell.simulation.noise_px = setting.noise_px;
  cell.simulation.robot_noise = setting.robot_noise;
  cell.options.has_camera.assign(cell.rig.cameras.size(), true);
  cell.options.choose_target_shape = false;
  return cell;
}

}  // namespace heba
