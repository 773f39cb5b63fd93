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
std::optional<Finding> CalibrateWithRobotErrors(const PairRunOptions& run, ArmSetup* arm, PairDataset* dataset,
                                                PairCalibrationOptions* options, PairCalibration* calibration) {
  RobotErrors errors;
  errors.smooth = run.smooth;
  const bool has_arm = arm != nullptr && arm->reason.empty();
  if (has_arm) {
    errors.arm = ErrorsOfArm(dataset->robot->arm, *arm, run.kinematics);
  }
  const std::optional<RobotNoise> noise_before = calibration->refined->robot_noise;
  RobotErrorsFound found = CalibrateRobotErrors(*calibration, *options, errors);
  if (has_arm && found.arm) {
    const std::vector<size_t>& branches = found.arm->branches;
    arm->reason = found.arm->reason;
    if (!branches.empty()) arm->branches = {Combined(arm->branches, branches)};
    if (!arm->is_recorded) arm->reason = WithRemedyOfJoints(arm->reason);
    for (size_t i = 0; i < dataset->captures.size() && arm->reason.empty(); ++i) {
      Capture& capture = dataset->captures[i];
      if (found.arm->model != nullptr) capture.effect = errors.arm.effects_of_captures[branches[i]][i];
      capture.gripper_by_joints = errors.arm.joints_of_captures[branches[i]][i];
    }
  }
  *calibration = std::move(found.calibration);
  *options = std::move(found.options);
  if (!found.smooth) return std::nullopt;
  for (Capture& capture : dataset->captures) {
    capture.effect = found.smooth->errors->EffectAt(capture.base_from_gripper);
  }
  return DescribeSmoothErrors({*calibration->refined->smooth_noise, found.smooth->errors->lengths(),
                               *calibration->refined->robot_noise, noise_before.value_or(RobotNoise{}),
                               found.smooth->p_value_without});
}

void SetEffectsOfPairs(const PairDataset& dataset, const PairRunOptions& run, ArmSetup* arm,
                       PoseCalibrationOptions* options, PairCalibration* calibration) {
  if (!arm->reason.empty()) return;
  const ArmErrorModels errors = ErrorsOfArm(dataset.robot->arm, *arm, run.kinematics);
  const std::optional<std::vector<size_t>> branches =
      MostLikelyBranchesOfPairs(dataset.setup, calibration->pairs, calibration->chain->hand_eye, errors);
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
