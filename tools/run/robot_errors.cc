#include "tools/run/robot_errors.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "heba/robot/arm_errors.h"
#include "solvers/calibration/smooth_search.h"
#include "tools/run/arm_assessment.h"
#include "tools/run/captures.h"

namespace heba {
namespace {

// Returns the reason why the errors that were asked for cannot be estimated; empty if they can.
std::string WhyNotEstimable(const Arm& arm, Kinematics kinematics) {
  if (kinematics != Kinematics::kGravity || arm.load != nullptr) return "";
  return "the masses of the arm's links are not known, which the compliance of its joints needs";
}

// Returns the effects on all captures, for each branch of the arm.
std::vector<std::vector<std::shared_ptr<const PoseEffect>>> EffectsOfBranches(const Dataset& dataset,
                                                                              const ArmSetup& arm) {
  std::vector<std::vector<std::shared_ptr<const PoseEffect>>> effects;
  for (const ArmBranch& branch : arm.branches) {
    effects.push_back(EffectsOf(dataset.robot->arm, arm.tip_from_gripper, branch));
  }
  return effects;
}

// Returns View::gripper_by_joints of all captures, for each branch of the arm; empty for captures without joints.
std::vector<std::vector<Matrix6X>> JointDerivativesOfBranches(const Dataset& dataset, const ArmSetup& arm) {
  std::vector<std::vector<Matrix6X>> derivatives;
  for (const ArmBranch& branch : arm.branches) {
    std::vector<Matrix6X>& of_branch = derivatives.emplace_back();
    for (const Eigen::VectorXd& joints : branch.joints) {
      of_branch.push_back(joints.size() == 0 ? Matrix6X(6, 0)
                                             : GripperByJoints(dataset.robot->arm, joints, arm.tip_from_gripper));
    }
  }
  return derivatives;
}

constexpr const char* kNoBranch = "the errors of the arm could be fitted in none of its configurations";

// Returns the errors of an arm that may be part of the model.
RigArmErrors ErrorsOf(const RunOptions& run, const ArmSetup& setup, const Dataset& dataset, size_t num_captures) {
  const Arm& nominal = dataset.robot->arm;
  RigArmErrors errors;
  errors.models = CandidateArmErrors(nominal, run.kinematics, num_captures);
  errors.is_chosen = run.kinematics == Kinematics::kAuto;
  errors.effects_of_captures = EffectsOfBranches(dataset, setup);
  // Servo errors are those of joints: beside the errors of an arm, white noise alone misjudges what the captures say.
  errors.joints_of_captures = JointDerivativesOfBranches(dataset, setup);
  errors.of_branches = std::make_shared<const SharedEffects>(ArmErrors(nominal, ArmErrorModel::kGeometry));
  return errors;
}

}  // namespace

std::optional<Finding> CalibrateWithRobotErrors(const RunOptions& run, ArmSetup* arm, Dataset* dataset,
                                                CalibrationOptions* options, Calibration* calibration) {
  RobotErrors errors;
  errors.smooth = run.smooth;
  if (arm != nullptr && arm->reason.empty()) arm->reason = WhyNotEstimable(dataset->robot->arm, run.kinematics);
  const bool has_arm = arm != nullptr && arm->reason.empty();
  if (has_arm) errors.arm = ErrorsOf(run, *arm, *dataset, calibration->views.size());
  const std::optional<RobotNoise> noise_before = calibration->refined->robot_noise;
  RobotErrorsFound found = CalibrateRobotErrors(*calibration, *options, errors);
  if (has_arm && found.arm) {
    const size_t branch = found.arm->branch;
    arm->reason = found.arm->reason;
    if (arm->reason != kNoBranch) arm->branches = {arm->branches[branch]};
    if (!arm->reason.empty() && !arm->is_recorded) {
      arm->reason += "; if the captures are in several configurations, record their joints (captures.joints)";
    }
    for (size_t i = 0; i < dataset->captures.size() && arm->reason.empty(); ++i) {
      Capture& capture = dataset->captures[i];
      if (found.arm->model != nullptr) capture.effect = errors.arm.effects_of_captures[branch][i];
      capture.gripper_by_joints = errors.arm.joints_of_captures[branch][i];
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

void SetEffectsOfPairs(const Dataset& dataset, const RunOptions& run, ArmSetup* arm, PoseCalibrationOptions* options,
                       Calibration* calibration) {
  const Arm& nominal = dataset.robot->arm;
  if (arm->reason.empty()) arm->reason = WhyNotEstimable(nominal, run.kinematics);
  if (!arm->reason.empty()) return;
  const std::vector<std::vector<std::shared_ptr<const PoseEffect>>> effects = EffectsOfBranches(dataset, *arm);
  size_t branch = 0;
  if (effects.size() > 1) {
    const auto geometry = std::make_shared<const SharedEffects>(ArmErrors(nominal, ArmErrorModel::kGeometry));
    const std::optional<size_t> found =
        MostLikelyPoseEffects(dataset.setup, calibration->pairs, calibration->chain->hand_eye, geometry, effects);
    if (!found) {
      arm->reason = kNoBranch;
      return;
    }
    branch = *found;
  }
  arm->branches = {arm->branches[branch]};
  for (size_t i = 0; i < calibration->pairs.size(); ++i) calibration->pairs[i].effect = effects[branch][i];
  options->effects = CandidateArmErrors(nominal, run.kinematics, calibration->pairs.size());
  options->must_have_effects = run.kinematics != Kinematics::kAuto;
}

}  // namespace heba
