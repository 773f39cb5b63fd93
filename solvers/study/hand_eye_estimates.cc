#include "solvers/study/hand_eye_estimates.h"

#include <string>

#include "heba/pair_calibration.h"
#include "solvers/closed_form/hand_eye_method.h"
#include "solvers/study/study_captures.h"
#include "solvers/study/study_places.h"

namespace heba {
namespace {

// Returns the options of the cell with its setup, camera, target and free intrinsics.
PairCalibrationOptions OptionsOf(const StudyCell& cell) {
  const ProblemCamera& camera = cell.problem.cameras[0];
  PairCalibrationOptions options = cell.options;
  options.setup = SetupOf(cell);
  options.camera = cell.gives_cameras ? std::optional(camera.camera) : std::nullopt;
  options.camera_model = camera.camera.model;
  options.width_px = camera.camera.width_px;
  options.height_px = camera.camera.height_px;
  options.shape = cell.problem.targets[0].shape;
  options.bundle.free_intrinsics = camera.free_intrinsics;
  return options;
}

// Returns whether an error model has the sources of error of the cell.
bool IsModelOf(const StudyCell& cell, const BundleOptions& bundle) {
  if (bundle.free_shape != ShapeGroupsOf(cell)) return false;
  const bool has_errors = DrawnErrors(cell) != nullptr;
  if (has_errors != (bundle.effects != nullptr)) return false;
  const bool has_joint_noise = cell.robot && cell.robot->joint_noise_rad > 0;
  const bool is_noisy = cell.robot_noise.translation_m > 0 || cell.robot_noise.rotation_rad > 0 || has_joint_noise;
  // Systematic errors are modelled beside noise, which may be zero.
  return has_errors || (bundle.robot != BundleOptions::Robot::kExact) == is_noisy;
}

// Returns the errors of the unknowns in a layout of this cell, whose robot has the systematic errors `drawn`.
Eigen::VectorXd ErrorOf(const StudyCell& cell, const UnknownLayout& layout, const PairSolution& solution,
                        const Eigen::VectorXd& drawn = {}) {
  const Camera& camera = cell.problem.cameras[0].camera;
  const HandEye truth = HandEyeOf(cell);
  const Tangent6 hand_eye =
      LocalCoordinates(truth.camera_mount_from_camera, solution.hand_eye.camera_mount_from_camera);
  const Tangent6 board = LocalCoordinates(truth.target_mount_from_target, solution.hand_eye.target_mount_from_target);
  Eigen::VectorXd error = Eigen::VectorXd::Zero(layout.size());
  for (const UnknownBlock& block : layout.blocks()) {
    for (Eigen::Index i = block.first; i < block.end(); ++i) {
      const auto k = static_cast<size_t>(layout[i].index);
      if (block.owner == UnknownOwner::kCamera) error[i] = solution.camera.params[k] - camera.params[k];
      if (block.owner == UnknownOwner::kEffects) {
        const auto effect = static_cast<size_t>(i - block.first);
        error[i] = solution.effects[i - block.first] - drawn[solution.shared_effects->effects[effect].index];
      }
      if (block.owner == UnknownOwner::kTarget) error[i] = solution.shape.params[k] - cell.shape_params[k];
      if (block.owner == UnknownOwner::kPose)
        error[i] = block.name == kHandEyeBlock ? hand_eye[i - block.first] : board[i - block.first];
    }
  }
  return error;
}

TrialEstimate FailedEstimate(const std::string& method) {
  TrialEstimate estimate;
  estimate.method = method;
  return estimate;
}

TrialEstimate EstimateOf(const StudyCell& cell, const std::string& method, const Outcome<HandEye>& hand_eye,
                         const std::vector<PosePair>& pairs) {
  TrialEstimate estimate;
  estimate.method = method;
  estimate.ok = hand_eye.ok();
  if (!hand_eye) return estimate;
  PairSolution poses;
  poses.hand_eye = *hand_eye;
  estimate.error = ErrorOf(cell, HandEyePoses(), poses);
  estimate.axxb_mean_mm = AxxbMeanMm(pairs, hand_eye->camera_mount_from_camera).value_or(0);
  return estimate;
}

TrialEstimate EstimateOf(const StudyCell& cell, const std::string& method, const Outcome<PairSolution>& solution,
                         const std::vector<PosePair>& pairs, const Eigen::VectorXd& drawn) {
  if (!solution) return FailedEstimate(method);
  TrialEstimate estimate = EstimateOf(cell, method, Outcome<HandEye>(solution->hand_eye), pairs);
  // The chain does not estimate intrinsics.
  const Eigen::VectorXd error = ErrorOf(cell, solution->covariance.layout, *solution, drawn);
  estimate.error = error(StudiedUnknowns(solution->covariance.layout));
  if (cell.robot && method == kBundleMethod) estimate.has_effects = solution->shared_effects != nullptr;
  estimate.is_covered = IsCovered(error, solution->covariance.matrix, solution->covariance_dof);
  estimate.pixel_sigma_px = solution->pixel_sigma_px;
  estimate.robot_noise = solution->robot_noise;
  return estimate;
}

}  // namespace

std::vector<Eigen::Index> StudiedUnknowns(const UnknownLayout& layout) {
  const UnknownBlock robot = layout.Block(kRobotBlock);
  std::vector<Eigen::Index> studied;
  for (Eigen::Index i = 0; i < layout.Block(kTargetBlock).first; ++i) {
    if (i < robot.first || i >= robot.end()) studied.push_back(i);
  }
  return studied;
}

std::vector<TrialEstimate> EstimateHandEye(const StudyCell& cell, Rng& rng) {
  const Eigen::VectorXd drawn = DrawErrors(cell, rng);
  const Outcome<PairCalibration> calibration = CalibratePair(SimulateViews(cell, drawn, rng), OptionsOf(cell));
  std::vector<TrialEstimate> estimates;
  if (!calibration) {
    for (const std::string& name : cell.options.methods) estimates.push_back(FailedEstimate(name));
    for (const char* name : {kChainMethod, kBundleMethod}) estimates.push_back(FailedEstimate(name));
    return estimates;
  }
  for (const MethodResult& method : calibration->methods) {
    // A method for another type of motion is left out of the study unless it was requested.
    const bool suits = FindHandEyeMethod(method.method)->motion == MethodMotion::kAny || method.hand_eye.ok();
    if (!suits && cell.options.methods.empty()) continue;
    estimates.push_back(EstimateOf(cell, method.method, method.hand_eye, calibration->pairs));
  }
  estimates.push_back(EstimateOf(cell, kChainMethod, calibration->chain, calibration->pairs, drawn));
  estimates.push_back(EstimateOf(cell, kBundleMethod, calibration->refined, calibration->pairs, drawn));
  if (calibration->refined && cell.robot) {
    estimates.back() = WithPlaceErrors(std::move(estimates.back()), cell, *calibration->refined, drawn, rng);
  }
  if (calibration->refined && !calibration->alternatives.empty()) {
    estimates.back().has_right_model = IsModelOf(cell, calibration->bundle);
  }
  return estimates;
}

}  // namespace heba
