#include "tools/run/robot_errors.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "heba/base/failure_code.h"
#include "heba/robot/arm_errors.h"
#include "solvers/calibration/smooth_search.h"
#include "tools/run/arm_assessment.h"
#include "tools/run/captures.h"

namespace heba {
namespace {

// Returns the entry of each capture in its branch.
template <class T>
std::vector<T> InBranches(const std::vector<std::vector<T>>& of_branches, const std::vector<size_t>& branches) {
  std::vector<T> of_captures;
  for (size_t i = 0; i < branches.size(); ++i) of_captures.push_back(of_branches[branches[i]][i]);
  return of_captures;
}

}  // namespace

std::optional<Finding> CalibrateWithRobotErrors(const Dataset& dataset, const RunOptions& run, ArmSetup* arm,
                                                EffectsOfCaptures* effects, PairCalibrationOptions* options,
                                                PairCalibration* calibration) {
  RobotErrors errors;
  errors.smooth = run.calibration.smooth;
  errors.robot_scale_sigma = RobotScaleSigmaOf(dataset);
  const bool has_arm = arm != nullptr && arm->reason.empty();
  if (has_arm) {
    errors.arm = ErrorsOfArm(dataset.arms.front()->arm, *arm, run.kinematics);
  }
  const std::optional<RobotNoise> noise_before = calibration->refined->robot_noise;
  RobotErrorsFound found = CalibrateRobotErrors(*calibration, *options, errors);
  if (has_arm && found.arm) {
    const std::vector<size_t>& branches = found.arm->branches;
    arm->reason = found.arm->reason;
    if (!branches.empty()) arm->branches = {Combined(arm->branches, branches)};
    if (!arm->is_recorded) arm->reason = WithRemedyOfJoints(arm->reason);
    if (arm->reason.empty()) {
      if (found.arm->model != nullptr) effects->effects = InBranches(errors.arm.effects_of_captures, branches);
      effects->gripper_by_joints = InBranches(errors.arm.joints_of_captures, branches);
    }
  }
  *calibration = std::move(found.calibration);
  *options = std::move(found.options);
  if (!found.smooth) return std::nullopt;
  effects->effects.clear();
  for (const Recording& capture : dataset.captures) {
    effects->effects.push_back(found.smooth->errors->EffectAt(capture.base_from_gripper.front()));
  }
  return DescribeSmoothErrors({*calibration->refined->smooth_noise, found.smooth->errors->lengths(),
                               *calibration->refined->robot_noise, noise_before.value_or(RobotNoise{}),
                               found.smooth->p_value_without});
}

void SetEffectsOfPairs(const Dataset& dataset, const RunOptions& run, ArmSetup* arm, PoseCalibrationOptions* options,
                       PairCalibration* calibration) {
  if (!arm->reason.empty()) return;
  const ArmErrorModels errors = ErrorsOfArm(dataset.arms.front()->arm, *arm, run.kinematics);
  const std::optional<std::vector<size_t>> branches =
      MostLikelyBranchesOfPairs(options->setup, calibration->pairs, calibration->chain->hand_eye, errors);
  if (!branches) {
    arm->reason = FailureCode("no_configuration_fits");
    return;
  }
  arm->branches = {Combined(arm->branches, *branches)};
  for (size_t i = 0; i < calibration->pairs.size(); ++i) {
    calibration->pairs[i].effect = errors.effects_of_captures[(*branches)[i]][i];
  }
  options->effects = errors.models;
  options->must_have_effects = !errors.is_chosen;
}

}  // namespace heba
