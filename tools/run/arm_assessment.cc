#include "tools/run/arm_assessment.h"

#include <algorithm>
#include <cmath>

#include "heba/base/failure_code.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/arm_uncertainty.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_postures.h"
#include "tools/run/captures.h"

namespace heba {

Failure WhyDeclined(const PairCalibration& calibration) {
  const ModelAlternative* chosen = nullptr;
  const ModelAlternative* best_with_arm = nullptr;
  for (const ModelAlternative& alternative : calibration.alternatives) {
    if (alternative.model.effects == nullptr) {
      const bool is_chosen = alternative.model.robot == calibration.bundle.robot &&
                             alternative.model.shape == calibration.bundle.free_shape;
      if (is_chosen) chosen = &alternative;
    } else if (best_with_arm == nullptr || alternative.log_likelihood > best_with_arm->log_likelihood) {
      best_with_arm = &alternative;
    }
  }
  if (chosen == nullptr || best_with_arm == nullptr) {
    return FailureCode("few_captures_of_arm");
  }
  return {FailureCode("no_better_model"),
          {{"gain", std::max(0.0, best_with_arm->log_likelihood - chosen->log_likelihood)},
           {"parameters", best_with_arm->dof - chosen->dof}},
          {{"model", NameOf(best_with_arm->model)}, {"chosen", NameOf(chosen->model)}}};
}

Failure WithRemedyOfJoints(const Failure& reason) {
  return reason.empty() ? reason : Failure{FailureCode("record_joints"), {}, {}, {reason}};
}

namespace {

// Returns the name of the configuration that all captures share; empty if there is none. The configuration of a
// singular capture is not known.
std::string CommonConfiguration(const Arm& arm, const ArmBranch& branch) {
  std::optional<Configuration> common;
  for (const Eigen::VectorXd& joints : branch.joints) {
    if (joints.size() == 0 || !SingularityAt(arm, joints).empty()) continue;
    const std::optional<Configuration> configuration = ConfigurationOf(arm, joints);
    if (!configuration || (common && *common != *configuration)) return "";
    common = configuration;
  }
  return common ? NameOf(*common) : "";
}

}  // namespace

RobotSummary SummariseArm(const RobotArm& robot, Kinematics kinematics, const std::optional<ArmSetup>& setup,
                          const std::vector<UndeterminedParam>& undetermined, const ArmEstimate& estimate) {
  RobotSummary summary;
  summary.nominal = robot.arm;
  summary.tip_from_gripper = setup ? setup->tip_from_gripper : robot.tip_from_gripper;
  summary.errors = Eigen::VectorXd::Zero(summary.nominal.num_params());
  summary.error_sigmas.resize(static_cast<size_t>(summary.nominal.num_params()));
  summary.noise_after = estimate.noise_after;
  summary.noise_before = estimate.noise_after;
  for (const UndeterminedParam& param : undetermined) {
    summary.undetermined.emplace_back(ArmParamName(param.place), param.with);
  }
  if (kinematics == Kinematics::kNone) summary.reason = FailureCode("kinematics_not_wanted");
  if (!setup) return summary;
  summary.has_recorded_joints = setup->is_recorded;
  if (setup->branches.size() == 1)
    summary.configuration = CommonConfiguration(summary.nominal, setup->branches.front());
  if (!setup->reason.empty()) {
    summary.reason = setup->reason;
    return summary;
  }
  if (estimate.errors == nullptr) {
    if (summary.reason.empty()) summary.reason = estimate.reason;
    return summary;
  }
  summary.is_estimated = true;
  summary.errors_name = estimate.errors->name;
  summary.errors = AllEffects(*estimate.errors, estimate.values);
  const bool yields =
      std::any_of(estimate.errors->effects.begin(), estimate.errors->effects.end(),
                  [](const SharedEffect& effect) { return ParamAt(effect.index) == ArmParam::kCompliance; });
  if (yields && setup->branches.size() == 1) {
    std::vector<Eigen::VectorXd> joints = setup->branches.front().joints;
    std::erase_if(joints, [](const Eigen::VectorXd& positions) { return positions.size() == 0; });
    summary.rigid = FitRigidEquivalent(summary.nominal, summary.errors, joints);
  }
  // A parameter whose sigma is nearly that of its prior was not determined by the captures.
  constexpr double kNothingLearnt = 0.9;
  for (Eigen::Index i = 0; i < estimate.errors->size(); ++i) {
    const SharedEffect& effect = estimate.errors->effects[static_cast<size_t>(i)];
    summary.error_sigmas[static_cast<size_t>(effect.index)] = estimate.stddev[i];
    if (estimate.stddev[i] > kNothingLearnt * estimate.group_sigmas[effect.group]) {
      summary.undetermined.emplace_back(effect.name, "its prior: these captures hardly depend on it");
    }
  }
  if (estimate.noise_before) summary.noise_before = estimate.noise_before;
  return summary;
}

RobotSummary SummariseArm(const Dataset& dataset, Kinematics kinematics, const std::optional<ArmSetup>& setup,
                          const PairCalibration& calibration) {
  const RobotArm& robot = *dataset.arms.front();
  const PairSolution& solution = calibration.refined ? *calibration.refined : *calibration.chain;
  ArmEstimate estimate;
  std::vector<Matrix6X> by_joints;
  for (const View& view : calibration.views) by_joints.push_back(view.gripper_by_joints);
  if (solution.robot_noise) estimate.noise_after = WithJointNoise(*solution.robot_noise, by_joints);
  const bool has_arm = solution.shared_effects != nullptr && solution.shared_effects->kind == SharedEffectsKind::kArm;
  if (has_arm) {
    const UnknownBlock block = solution.covariance.layout.Block(kRobotBlock);
    estimate.errors = solution.shared_effects;
    estimate.values = solution.effects;
    estimate.stddev = solution.covariance.matrix.diagonal().segment(block.first, block.size).cwiseSqrt();
    estimate.group_sigmas = solution.effect_sigmas;
    for (const ModelAlternative& alternative : calibration.alternatives) {
      if (alternative.model.effects == nullptr && alternative.robot_noise &&
          alternative.model.shape == calibration.bundle.free_shape) {
        estimate.noise_before = WithJointNoise(*alternative.robot_noise, by_joints);
      }
    }
  } else {
    estimate.reason = WhyDeclined(calibration);
  }
  return SummariseArm(robot, kinematics, setup, UndeterminedParams(robot.arm, SetupOf(dataset)), estimate);
}

Finding DescribeEstimate(const RobotSummary& robot) {
  const std::pair<std::string, std::string> arm = {"arm", robot.nominal.name};
  if (!robot.is_estimated) {
    // An arm that was given and contradicts the data is not passed over.
    Finding declined{
        IsContradiction(robot.reason) ? Grade::kDoubtful : Grade::kGood, FindingCode("arm_declined"), {}, {arm}};
    declined.reason = robot.reason;
    return declined;
  }
  Finding finding{Grade::kGood, FindingCode("arm_estimated"), {}, {arm, {"errors", robot.errors_name}}};
  if (const std::vector<std::string> implausible = ImplausibleErrors(robot); !implausible.empty()) {
    finding.grade = Grade::kDoubtful;
    finding.names.emplace_back("implausible", Join(implausible, ", "));
  }
  // Without a model that lacks the errors of the arm, there is nothing to compare.
  const bool falls = robot.noise_before && robot.noise_after &&
                     (robot.noise_before->translation_m != robot.noise_after->translation_m ||
                      robot.noise_before->rotation_rad != robot.noise_after->rotation_rad);
  if (falls) {
    finding.numbers = {{"before_mm", 1000 * robot.noise_before->translation_m},
                       {"before_deg", RadToDeg(robot.noise_before->rotation_rad)},
                       {"after_mm", 1000 * robot.noise_after->translation_m},
                       {"after_deg", RadToDeg(robot.noise_after->rotation_rad)}};
  }
  return finding;
}

Finding DescribeConfiguration(const RobotSummary& robot, const GripperLocator& locate,
                              const std::vector<Rigid3d>& base_from_gripper) {
  Finding finding{Grade::kGood, FindingCode("arm_one_configuration"), {}, {{"configuration", robot.configuration}}};
  const std::optional<ConfigurationSigmas> sigmas =
      locate ? SigmasByConfiguration(locate, robot, base_from_gripper) : std::nullopt;
  if (!sigmas || !sigmas->others_m) return finding;
  finding.numbers = {{"captured_mm", 1000 * sigmas->captured_m}, {"others_mm", 1000 * *sigmas->others_m}};
  // Errors that are larger by this factor than at the captures are not told by them.
  constexpr double kMuchLarger = 3;
  std::vector<std::string> wanted;
  for (size_t k = 0; k < kFlipNames.size(); ++k) {
    if (!sigmas->flipped_m[k]) continue;
    finding.numbers.emplace_back(std::string(kFlipNames[k]) + "_mm", 1000 * *sigmas->flipped_m[k]);
    if (*sigmas->flipped_m[k] > kMuchLarger * sigmas->captured_m) wanted.emplace_back(kFlipNames[k]);
  }
  if (!wanted.empty()) finding.names.emplace_back("flip", Join(wanted, ", "));
  return finding;
}

std::vector<Finding> FindingsOf(const RobotSummary& robot, Setup setup, const PairCalibration& calibration) {
  std::vector<Finding> findings = {DescribeEstimate(robot)};
  if (!robot.is_estimated) return findings;
  if (robot.configuration.empty()) return findings;
  std::vector<Rigid3d> base_from_gripper;
  for (const View& view : calibration.views) {
    base_from_gripper.push_back(GripperPoseOf(setup, view).base_from_mount);
  }
  const GripperLocator locate = calibration.refined ? LocatorOf(setup, *calibration.refined) : GripperLocator();
  findings.push_back(DescribeConfiguration(robot, locate, base_from_gripper));
  return findings;
}

std::optional<Finding> FindSingularCaptures(const Dataset& dataset, size_t robot, const ArmSetup& setup,
                                            bool is_estimated) {
  // The captures have not told the branches apart if there are several.
  if (setup.branches.size() != 1) return std::nullopt;
  const std::vector<SingularCapture> singular = SingularCaptures(dataset.arms[robot]->arm, setup.branches.front());
  if (singular.empty()) return std::nullopt;
  constexpr size_t kMostNames = 5;
  std::vector<std::string> names;
  for (size_t i = 0; i < std::min(singular.size(), kMostNames); ++i) {
    names.push_back(dataset.captures[singular[i].capture].name);
  }
  if (singular.size() > kMostNames) names.emplace_back("...");
  return Finding{is_estimated && !setup.is_recorded ? Grade::kDoubtful : Grade::kGood,
                 FindingCode("arm_singular_captures"),
                 {{"captures", static_cast<double>(singular.size())},
                  {"of_captures", static_cast<double>(dataset.captures.size())}},
                 {{"arm", dataset.arms[robot]->arm.name},
                  {"names", Join(names, ", ")},
                  {"singularity", singular.front().singularity},
                  {"joints", setup.is_recorded ? "recorded" : "recovered"}}};
}

}  // namespace heba
