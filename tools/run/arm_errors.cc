#include "tools/run/arm_errors.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "heba/robot/arm_errors.h"
#include "solvers/calibration/model_search.h"
#include "tools/run/arm_assessment.h"

namespace heba {
namespace {

const ArmErrorChoice* FindChoice(const Calibration& calibration, size_t robot) {
  const auto found = std::find_if(calibration.arms.begin(), calibration.arms.end(),
                                  [&](const ArmErrorChoice& choice) { return choice.robot == robot; });
  return found == calibration.arms.end() ? nullptr : &*found;
}

// Returns what a calibration says about an arm; `choice` may be null.
ArmEstimate EstimateOf(const Calibration& calibration, const ArmErrorChoice* choice, size_t robot) {
  const Solution& solution = *calibration.refined;
  ArmEstimate estimate;
  estimate.noise_after = NoiseOfPoses(calibration.problem, solution, robot);
  if (choice == nullptr) return estimate;
  estimate.reason = choice->reason;
  if (choice->model == nullptr) return estimate;
  const UnknownBlock block = solution.covariance.layout.Block(ErrorsBlock(calibration.problem.robots[robot]));
  estimate.errors = choice->model;
  estimate.values = solution.effects[robot];
  estimate.stddev = solution.covariance.matrix.diagonal().segment(block.first, block.size).cwiseSqrt();
  estimate.group_sigmas = solution.effect_sigmas[robot];
  estimate.noise_before = choice->noise_before;
  return estimate;
}

}  // namespace

std::vector<std::optional<ArmSetup>> SetUpArms(const Dataset& dataset, Kinematics kinematics) {
  std::vector<std::optional<ArmSetup>> setups;
  for (size_t r = 0; r < dataset.arms.size(); ++r) {
    setups.emplace_back();
    if (!dataset.arms[r] || kinematics == Kinematics::kNone) continue;
    setups.back() = SetUpArm(dataset, r, kinematics);
  }
  return setups;
}

std::vector<ArmErrorModels> ErrorsOfArms(const Dataset& dataset, const std::vector<std::optional<ArmSetup>>& setups,
                                         Kinematics kinematics) {
  std::vector<ArmErrorModels> errors(setups.size());
  for (size_t r = 0; r < setups.size(); ++r) {
    if (!setups[r] || !setups[r]->reason.empty()) continue;
    errors[r] = ErrorsOfArm(dataset.arms[r]->arm, *setups[r], kinematics);
  }
  return errors;
}

ArmSummaries SummariseArms(const Dataset& dataset, std::vector<std::optional<ArmSetup>> setups, Kinematics kinematics,
                           const Calibration& calibration) {
  ArmSummaries summaries;
  for (size_t r = 0; r < dataset.arms.size(); ++r) {
    summaries.arms.emplace_back();
    if (!dataset.arms[r]) continue;
    const RobotArm& robot = *dataset.arms[r];
    const ArmErrorChoice* const choice = FindChoice(calibration, r);
    ArmEstimate estimate = EstimateOf(calibration, choice, r);
    if (estimate.errors != nullptr) {
      setups[r]->branches = {Combined(setups[r]->branches, choice->branches)};
    } else if (choice != nullptr && !setups[r]->is_recorded) {
      estimate.reason = WithRemedyOfJoints(estimate.reason);
    }
    summaries.arms.back() = SummariseArm(robot, kinematics, setups[r],
                                         UndeterminedParams(robot.arm, "the poses of what is fixed in the base",
                                                            "the poses of what the gripper carries"),
                                         estimate);
    RobotSummary& arm = *summaries.arms.back();
    std::vector<Finding> findings = {DescribeEstimate(arm)};
    if (arm.is_estimated && !arm.configuration.empty()) {
      const std::optional<FixedPart> fixed = FindFixedPart(calibration.problem);
      std::vector<Rigid3d> base_from_gripper;
      for (const ProblemCapture& capture : calibration.problem.captures) {
        const bool is_used = std::any_of(capture.images.begin(), capture.images.end(),
                                         [](const ProblemImage& image) { return image.observations.size() > 0; });
        if (is_used) base_from_gripper.push_back(capture.base_from_gripper[r]);
      }
      findings.push_back(DescribeConfiguration(
          arm, fixed ? LocatorOf(calibration.problem, *calibration.refined, r, *fixed) : GripperLocator(),
          base_from_gripper));
    }
    if (setups[r]) {
      std::optional<Finding> singular = FindSingularCaptures(dataset, r, *setups[r], arm.is_estimated);
      if (singular) findings.push_back(std::move(*singular));
    }
    for (Finding& finding : findings) {
      finding.names.emplace_back("of_arm", dataset.rig.robots[r]);
      summaries.findings.push_back(std::move(finding));
    }
  }
  return summaries;
}

std::vector<Finding> WithNamesOfArms(std::vector<Finding> findings,
                                     const std::vector<std::optional<RobotSummary>>& arms,
                                     const std::vector<std::string>& robots) {
  for (Finding& finding : findings) {
    if (finding.code != "smooth_errors") continue;
    for (size_t r = 0; r < arms.size(); ++r) {
      if (arms[r] && finding.Name("of_arm") == robots[r]) finding.names.emplace_back("arm", arms[r]->nominal.name);
    }
  }
  return findings;
}

}  // namespace heba
