#include "tests/support/study_cells.h"

namespace heba {

StudyCell CellOf(const CellScene& scene, const CellSceneSetting& setting) {
  StudyCell cell;
  cell.problem = scene.problem;
  cell.problem.captures.clear();
  cell.poses = scene.truth;
  for (const SimulatedTarget& target : scene.targets) {
    StudyTarget& studied = cell.targets.emplace_back();
    studied.points.points_in_target = target.points_in_target;
    studied.z_out = target.z_out;
  }
  for (const ArmPoses& arms : scene.arms) cell.captures.push_back({{}, arms});
  cell.pixel_sigma_px = setting.noise_px;
  cell.robot_noise = setting.robot_noise;
  cell.options.choose.target_shape = false;
  cell.options.bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  return cell;
}

}  // namespace heba
