#include "tools/run/robot_errors.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "heba/robot/arm_errors.h"
#include "solvers/calibration/model_choice.h"
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

// Calibrates again with other options, which may choose among effects. If that fails, or if no effects are chosen,
// returns the reason and keeps the calibration and its options.
std::optional<std::string> Recalibrate(const Dataset& dataset, CalibrationOptions with_effects,
                                       CalibrationOptions* options, Calibration* calibration) {
  std::vector<std::shared_ptr<const PoseEffect>> effects;
  std::vector<Matrix6X> by_joints;
  for (const Capture& capture : dataset.captures) {
    effects.push_back(capture.effect);
    by_joints.push_back(capture.gripper_by_joints);
  }
  Outcome<Calibration> again = CalibrateWithEffects(*calibration, with_effects, effects, by_joints);
  if (!again) return "the refinement with the robot's errors failed: " + again.reason();
  if (!with_effects.choose.effects.empty() && again->bundle.effects == nullptr) return WhyDeclined(*again);
  *calibration = std::move(*again);
  *options = std::move(with_effects);
  return std::nullopt;
}

}  // namespace

void CalibrateWithArm(const RunOptions& run, ArmSetup* arm, Dataset* dataset, CalibrationOptions* options,
                      Calibration* calibration) {
  const Arm& nominal = dataset->robot->arm;
  if (arm->reason.empty()) arm->reason = WhyNotEstimable(nominal, run.kinematics);
  if (!arm->reason.empty()) return;
  const std::vector<std::vector<std::shared_ptr<const PoseEffect>>> effects = EffectsOfBranches(*dataset, *arm);
  const std::vector<std::vector<Matrix6X>> by_joints = JointDerivativesOfBranches(*dataset, *arm);
  size_t branch = 0;
  if (effects.size() > 1) {
    BundleOptions bundle = calibration->bundle;
    bundle.effects = std::make_shared<const SharedEffects>(ArmErrors(nominal, ArmErrorModel::kGeometry));
    bundle.target_scale_sigma = kPrintScaleSigma;
    if (options->choose.target_shape) bundle.free_shape = TargetShapeCombinations().back();
    const std::optional<size_t> found =
        MostLikelyEffects({calibration->camera, calibration->views, options->setup, options->shape},
                          *calibration->refined, bundle, effects, by_joints);
    if (!found) {
      arm->reason = kNoBranch;
      return;
    }
    branch = *found;
  }
  arm->branches = {arm->branches[branch]};
  CalibrationOptions with_arm = *options;
  const std::vector<std::shared_ptr<const SharedEffects>> candidates =
      CandidateArmErrors(nominal, run.kinematics, calibration->views.size());
  if (!candidates.empty()) with_arm.bundle.target_scale_sigma = kPrintScaleSigma;
  if (run.kinematics == Kinematics::kAuto) {
    with_arm.choose.effects = candidates;
  } else if (!candidates.empty()) {
    with_arm.bundle.effects = candidates.front();
  }
  for (size_t i = 0; i < dataset->captures.size(); ++i) {
    Capture& capture = dataset->captures[i];
    if (!candidates.empty()) capture.effect = effects[branch][i];
    // Servo errors are those of joints: beside the errors of an arm, white noise alone misjudges what the captures say.
    capture.gripper_by_joints = by_joints[branch][i];
  }
  const std::optional<std::string> why_not = Recalibrate(*dataset, with_arm, options, calibration);
  if (!why_not) return;
  arm->reason = *why_not;
  if (!arm->is_recorded)
    arm->reason += "; if the captures are in several configurations, record their joints (captures.joints)";
  for (Capture& capture : dataset->captures) {
    capture.effect = nullptr;
    capture.gripper_by_joints.resize(6, 0);
  }
}

// Lists the models without smooth errors that were compared before, the chosen one of which was then compared with the
// one with smooth errors.
void AddModelsBefore(const FoundSmoothErrors& found, const Calibration& before, Calibration* calibration) {
  const ErrorModel without{before.bundle.robot, before.bundle.free_shape, before.bundle.effects};
  const ErrorModel with{calibration->bundle.robot, before.bundle.free_shape, calibration->bundle.effects};
  const auto entry_of = [](std::vector<ModelAlternative>* alternatives, const ErrorModel& model,
                           const std::optional<RobotNoise>& robot_noise) {
    const auto entry = std::find_if(alternatives->begin(), alternatives->end(), [&](const ModelAlternative& other) {
      return other.model.robot == model.robot && other.model.shape == model.shape &&
             other.model.effects == model.effects;
    });
    if (entry != alternatives->end()) return entry;
    return alternatives->insert(alternatives->end(), {model, 0, robot_noise, DofOf(model), std::nullopt});
  };
  std::vector<ModelAlternative> alternatives = before.alternatives;
  const double log_likelihood_with =
      entry_of(&calibration->alternatives, with, calibration->refined->robot_noise)->log_likelihood;
  const auto chosen = entry_of(&alternatives, without, before.refined->robot_noise);
  const double shift = log_likelihood_with - found.log_likelihood_gain - chosen->log_likelihood;
  chosen->p = PValueWithout(found);
  chosen->odds = found.odds_without;
  for (ModelAlternative& alternative : alternatives) alternative.log_likelihood += shift;
  alternatives.insert(alternatives.end(), calibration->alternatives.begin(), calibration->alternatives.end());
  calibration->alternatives = std::move(alternatives);
}

// Calibrates again, with errors of the robot's poses that vary smoothly with the pose among what is estimated. Changes
// nothing if the robot is exact or its noise white. Returns a finding if such errors are part of the calibration.
std::optional<Finding> CalibrateWithSmoothErrors(const RunOptions& run, Dataset* dataset, CalibrationOptions* options,
                                                 Calibration* calibration) {
  const BundleOptions& bundle = calibration->bundle;
  const bool is_free = bundle.robot == BundleOptions::Robot::kEstimatedNoise || options->choose.robot_noise;
  if (run.smooth == SmoothPoseErrors::kNone || !is_free || bundle.robot_noise_prior) return std::nullopt;
  const std::optional<FoundSmoothErrors> found = MostLikelySmoothErrors(
      {calibration->camera, calibration->views, options->setup, options->shape}, *calibration->refined, bundle);
  if (!found || (run.smooth == SmoothPoseErrors::kAuto && !AreLikely(*found))) return std::nullopt;
  const Calibration before = *calibration;
  const SmoothErrors& errors = found->errors;
  CalibrationOptions with_errors = *options;
  // The target's scale and the size of the arm are nearly one.
  if (!with_errors.bundle.target_scale_sigma) with_errors.bundle.target_scale_sigma = kPrintScaleSigma;
  with_errors.choose.robot_noise = false;
  with_errors.bundle.robot = BundleOptions::Robot::kEstimatedNoise;
  with_errors.bundle.effects = std::make_shared<const SharedEffects>(errors.effects());
  for (Capture& capture : dataset->captures) capture.effect = errors.EffectAt(capture.base_from_gripper);
  const std::optional<std::string> why_not = Recalibrate(*dataset, with_errors, options, calibration);
  const std::optional<RobotNoise> smooth = calibration->refined->smooth_noise;
  if (!why_not && smooth) {
    if (run.smooth == SmoothPoseErrors::kAuto) AddModelsBefore(*found, before, calibration);
    return DescribeSmoothErrors({*smooth, errors.lengths(), *calibration->refined->robot_noise,
                                 before.refined->robot_noise.value_or(RobotNoise{}), PValueWithout(*found)});
  }
  for (Capture& capture : dataset->captures) capture.effect = nullptr;
  return std::nullopt;
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
