#include "solvers/refine/hand_eye_problem.h"

#include <memory>
#include <utility>

namespace heba {

Problem HandEyeProblem(const PairProblem& problem, const BundleOptions& options) {
  Problem whole = HandEyeProblem(problem.setup, problem.camera, problem.shape);
  ProblemCamera& camera = whole.cameras[0];
  camera.free_intrinsics = options.free_intrinsics;
  camera.prior = options.camera_prior;
  ProblemTarget& target = whole.targets[0];
  target.free_shape = options.free_shape;
  target.scale_sigma = options.target_scale_sigma;
  target.known_scale_sigma = options.known_target_scale_sigma;
  whole.prior = options.prior;
  const SharedEffects* const shared = options.effects.get();
  std::vector<int> estimated;
  if (shared != nullptr) {
    whole.effects = {options.effects};
    for (const SharedEffect& effect : shared->effects) estimated.push_back(effect.index);
  }
  whole.captures.reserve(problem.views.size());
  for (const View& view : problem.views) {
    ProblemCapture& capture = whole.captures.emplace_back();
    capture.name = view.name;
    capture.base_from_gripper = {BaseFromGripper(problem.setup, view.camera_mount_from_target_mount)};
    capture.images.push_back({0, 0, view.observations});
    if (view.gripper_by_joints.cols() > 0 || !view.joints.empty()) {
      capture.postures = {{view.gripper_by_joints, view.joints}};
    }
    if (shared == nullptr) continue;
    // The effect of a view is a function of all effects of its model.
    capture.effects.push_back(view.effect == nullptr ? nullptr
                                                     : SelectEffects(view.effect, shared->num_all, estimated));
  }
  return whole;
}

HandEye HandEyeOf(const CellPoses& poses) { return {poses.mount_from_camera[0], poses.mount_from_target[0]}; }

PairSolution HandEyeSolution(const Solution& whole, const BundleOptions& options) {
  PairSolution solution;
  solution.hand_eye = HandEyeOf(whole.poses);
  solution.camera = whole.cameras[0];
  solution.shape = whole.shapes[0];
  solution.shared_effects = options.effects;
  if (options.effects != nullptr) {
    solution.effects = whole.effects[0];
    solution.effect_sigmas = whole.effect_sigmas[0];
  }
  solution.smooth_noise = SmoothNoiseOf(whole, 0);
  solution.pixel_sigma_px = whole.pixel_sigmas_px[0];
  solution.unmodelled_sigma_px = whole.unmodelled_sigma_px[0];
  solution.robot_noise = whole.robot_noise[0];
  solution.robot_noise_stddev = whole.robot_noise_stddev[0];
  for (const CaptureOutcome& capture : whole.captures) {
    ViewOutcome& view = solution.views.emplace_back();
    if (!capture.corrections.empty()) view.correction = capture.corrections[0];
    view.rejected_ids = capture.rejected_ids[0];
  }
  solution.covariance = whole.covariance;
  solution.covariance_repeatable = whole.covariance_repeatable;
  solution.covariance_dof = whole.covariance_dof;
  solution.convergence = whole.convergence;
  return solution;
}

}  // namespace heba
