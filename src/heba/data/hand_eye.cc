#include "heba/data/hand_eye.h"

namespace heba {

Problem HandEyeProblem(Setup setup, const Camera& camera, const TargetShape& shape) {
  const bool is_in_hand = setup == Setup::kEyeInHand;
  const Mount base{0, Mount::Part::kBase};
  const Mount gripper{0, Mount::Part::kGripper};
  Problem problem;
  problem.robots = {""};
  ProblemCamera& of_camera = problem.cameras.emplace_back();
  of_camera.mount = is_in_hand ? gripper : base;
  of_camera.mount_name = CameraMountName(setup);
  of_camera.camera = camera;
  ProblemTarget& target = problem.targets.emplace_back();
  target.mount = is_in_hand ? base : gripper;
  target.mount_name = TargetMountName(setup);
  target.shape = shape;
  return problem;
}

Problem HandEyeProblem(Setup setup, const PairSolution& solution) {
  Problem problem = HandEyeProblem(setup, solution.camera, solution.shape);
  if (solution.shared_effects != nullptr) problem.effects = {solution.shared_effects};
  return problem;
}

CellPoses HandEyePosesOf(const HandEye& hand_eye) {
  return {{hand_eye.camera_mount_from_camera}, {hand_eye.target_mount_from_target}, {Rigid3d()}};
}

Solution ProblemSolution(const PairSolution& solution) {
  Solution whole;
  whole.poses = HandEyePosesOf(solution.hand_eye);
  whole.cameras = {solution.camera};
  whole.shapes = {solution.shape};
  whole.pixel_sigmas_px = {solution.pixel_sigma_px};
  whole.image_sigmas_px = {0};
  whole.unmodelled_sigma_px = {solution.unmodelled_sigma_px};
  whole.robot_noise = {solution.robot_noise};
  whole.robot_noise_stddev = {solution.robot_noise_stddev};
  if (solution.shared_effects != nullptr) {
    whole.effects = {solution.effects};
    whole.effect_sigmas = {solution.effect_sigmas};
  }
  whole.smooth_noise = {solution.smooth_noise};
  for (const ViewOutcome& view : solution.views) {
    CaptureOutcome& capture = whole.captures.emplace_back();
    if (view.correction) capture.corrections = {*view.correction};
    capture.rejected_ids = {view.rejected_ids};
  }
  whole.covariance = solution.covariance;
  whole.covariance_repeatable = solution.covariance_repeatable;
  whole.covariance_dof = solution.covariance_dof;
  whole.convergence = solution.convergence;
  return whole;
}

}  // namespace heba
