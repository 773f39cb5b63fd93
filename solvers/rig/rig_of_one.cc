#include "solvers/rig/rig_of_one.h"

#include <algorithm>
#include <utility>

namespace heba {

RigOfOne AsRig(const Calibration& calibration, const CalibrationOptions& options) {
  const Solution& solution = *calibration.refined;
  const BundleOptions& bundle = calibration.bundle;
  const bool is_in_hand = options.setup == Setup::kEyeInHand;
  const Mount base{0, Mount::Part::kBase};
  const Mount gripper{0, Mount::Part::kGripper};
  RigOfOne rig;
  RigProblem& problem = rig.problem;
  problem.robots = {""};
  problem.cameras = {{"", is_in_hand ? gripper : base, calibration.camera, bundle.free_intrinsics}};
  problem.cameras[0].prior = bundle.camera_prior;
  problem.targets = {{"", is_in_hand ? base : gripper, options.shape, bundle.free_shape, options.symmetries}};
  problem.targets[0].scale_sigma = bundle.target_scale_sigma;
  // The effects that were estimated; those of a view are all of its model.
  const SharedEffects* const shared = solution.shared_effects.get();
  problem.effects = {solution.shared_effects};
  std::vector<int> estimated;
  for (size_t k = 0; shared != nullptr && k < shared->effects.size(); ++k) {
    estimated.push_back(shared->effects[k].index);
  }

  // Views of one capture, and whether they are used.
  std::vector<std::pair<const View*, bool>> views;
  for (const View& view : calibration.views) views.emplace_back(&view, true);
  for (const View& view : calibration.left_out) views.emplace_back(&view, false);
  std::stable_sort(views.begin(), views.end(),
                   [](const auto& a, const auto& b) { return a.first->capture < b.first->capture; });
  for (const auto& [view, is_used] : views) {
    const Rigid3d& mounts = view->camera_mount_from_target_mount;
    if (!is_used) rig.judged.left_out.insert({problem.captures.size(), 0});
    rig.captures.push_back(view->capture);
    std::shared_ptr<const PoseEffect> effect;
    if (shared != nullptr && view->effect != nullptr) effect = SelectEffects(view->effect, shared->num_all, estimated);
    problem.captures.push_back(
        {view->name, {is_in_hand ? Inverse(mounts) : mounts}, {{0, 0, view->observations}}, {std::move(effect)}});
  }

  RigSolution& joint = rig.judged.solution;
  joint.poses = {
      {solution.hand_eye.camera_mount_from_camera}, {solution.hand_eye.target_mount_from_target}, {Rigid3d()}};
  joint.cameras = {solution.camera};
  joint.shapes = {solution.shape};
  joint.effects = {solution.effects};
  joint.effect_sigmas = {solution.effect_sigmas};
  return rig;
}

}  // namespace heba
