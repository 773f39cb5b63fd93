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

RobotCalibration CalibrateWithRobotErrors(const Dataset& dataset, const RunOptions& run, RobotCalibration without) {
  RobotErrors errors;
  errors.smooth = run.calibration.smooth;
  errors.robot_scale_sigma = RobotScaleSigmaOf(dataset);
  RobotCalibration with = std::move(without);
  const bool has_arm = with.arm && with.arm->reason.empty();
  if (has_arm) errors.arm = ErrorsOfArm(dataset.arms.front()->arm, *with.arm, run.kinematics);
  const std::optional<RobotNoise> noise_before = with.calibration.refined->robot_noise;
  RobotErrorsFound found = CalibrateRobotErrors(with.calibration, with.options, errors);
  if (has_arm && found.arm) {
    ArmSetup& arm = *with.arm;
    const std::vector<size_t>& branches = found.arm->branches;
    arm.reason = found.arm->reason;
    if (!branches.empty()) arm.branches = {Combined(arm.branches, branches)};
    if (!arm.is_recorded) arm.reason = WithRemedyOfJoints(arm.reason);
    if (arm.reason.empty()) {
      if (found.arm->model != nullptr) with.effects.effects = InBranches(errors.arm.effects_of_captures, branches);
      with.effects.gripper_by_joints = InBranches(errors.arm.joints_of_captures, branches);
    }
  }
  with.calibration = std::move(found.calibration);
  with.options = std::move(found.options);
  if (!found.smooth) return with;
  with.effects.effects = EffectsAt(dataset, *found.smooth->errors);
  const PairSolution& refined = *with.calibration.refined;
  with.of_smooth_errors =
      DescribeSmoothErrors({*refined.smooth_noise, found.smooth->errors->lengths(), *refined.robot_noise,
                            noise_before.value_or(RobotNoise{}), found.smooth->p_value_without});
  return with;
}

ArmOfPairs SetUpArmOfPairs(const Dataset& dataset, const RunOptions& run, ArmSetup arm,
                           const PoseCalibrationOptions& options, const PairCalibration& calibration) {
  ArmOfPairs set_up{std::move(arm), options, calibration.pairs};
  set_up.options.has_robot_noise = true;
  if (!set_up.arm.reason.empty()) return set_up;
  const ArmErrorModels errors = ErrorsOfArm(dataset.arms.front()->arm, set_up.arm, run.kinematics);
  const std::optional<std::vector<size_t>> branches =
      MostLikelyBranchesOfPairs(options.setup, calibration.pairs, calibration.chain->hand_eye, errors);
  if (!branches) {
    set_up.arm.reason = FailureCode("no_configuration_fits");
    return set_up;
  }
  set_up.arm.branches = {Combined(set_up.arm.branches, *branches)};
  for (size_t i = 0; i < set_up.pairs.size(); ++i) {
    set_up.pairs[i].effect = errors.effects_of_captures[(*branches)[i]][i];
  }
  set_up.options.effects = errors.models;
  set_up.options.must_have_effects = !errors.is_chosen;
  return set_up;
}

}  // namespace heba
