#include "heba/data/pair_solution.h"

namespace heba {

Rigid3d CorrectedMount(Setup setup, const Rigid3d& camera_mount_from_target_mount, const PoseEffect* effect,
                       const PairSolution& solution) {
  if (solution.shared_effects == nullptr || effect == nullptr) return camera_mount_from_target_mount;
  const Eigen::VectorXd all = AllEffects(*solution.shared_effects, solution.effects);
  return CorrectedMount(setup, camera_mount_from_target_mount, effect->Evaluate(all, nullptr));
}

Rigid3d CorrectedMount(Setup setup, const View& view, const PairSolution& solution) {
  return CorrectedMount(setup, view.camera_mount_from_target_mount, view.effect.get(), solution);
}

std::vector<View> CorrectedViews(Setup setup, const std::vector<View>& views, const PairSolution& solution) {
  std::vector<View> corrected = views;
  for (View& view : corrected) {
    view.camera_mount_from_target_mount = CorrectedMount(setup, view, solution);
    view.effect = nullptr;
  }
  return corrected;
}

}  // namespace heba
