#include "tests/support/rig_study_cells.h"

namespace heba {

RigStudyCell CellOf(const RigScene& scene, const RigSceneSetting& setting) {
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
