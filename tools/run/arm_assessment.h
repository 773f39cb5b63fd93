// The statements of a run about the arm: its estimated kinematics, or the reason why they were not estimated.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/evaluation/arm_uncertainty.h"
#include "heba/robot/arm_errors.h"
#include "heba/run_types.h"
#include "tools/run/arm_setup.h"

namespace heba {

// The part of a calibration that concerns one arm.
struct ArmEstimate {
  std::shared_ptr<const SharedEffects> errors;  // The estimated errors; null if none were estimated.
  Failure reason;                               // The reason if none were.
  Eigen::VectorXd values;                       // One per error.
  Eigen::VectorXd stddev;                       // One sigma of each.
  std::vector<double> group_sigmas;             // The standard deviation of each group of errors.
  std::optional<RobotNoise> noise_before;       // The noise of the poses without the errors and with them.
  std::optional<RobotNoise> noise_after;
};
// Describes the estimation of an arm's kinematics. `setup` is empty if none was wanted; `undetermined` are the
// parameters that no captures determine.
RobotSummary SummariseArm(const RobotArm& robot, Kinematics kinematics, const std::optional<ArmSetup>& setup,
                          const std::vector<UndeterminedParam>& undetermined, const ArmEstimate& estimate);

// Likewise for a calibration of one camera and one target.
RobotSummary SummariseArm(const Dataset& dataset, Kinematics kinematics, const std::optional<ArmSetup>& setup,
                          const PairCalibration& calibration);

// Returns the reason why the chosen model has no systematic errors of the robot, from the models that were compared.
Failure WhyDeclined(const PairCalibration& calibration);

// Returns the reason of an arm whose joints were not recorded, with the advice to record them; no failure for none.
Failure WithRemedyOfJoints(const Failure& reason);

// Returns the finding that the errors of the arm were estimated, with the noise without and with them, or that they
// were not.
Finding DescribeEstimate(const RobotSummary& robot);

// Returns what is to be said about it. `calibration` is the one that estimated the arm.
std::vector<Finding> FindingsOf(const RobotSummary& robot, Setup setup, const PairCalibration& calibration);

// Returns the finding that all captures are in one configuration, with the sigmas of the gripper's position there and
// in others. Names the flips that the captures do not tell the arm's errors for. Without `locate` there are no sigmas.
// `base_from_gripper` are the poses of the captures.
Finding DescribeConfiguration(const RobotSummary& robot, const GripperLocator& locate,
                              const std::vector<Rigid3d>& base_from_gripper);

// Returns the finding about captures at or close to a singularity of an arm, if there are any. It is doubtful if the
// arm was estimated from joints that were recovered there.
std::optional<Finding> FindSingularCaptures(const Dataset& dataset, size_t robot, const ArmSetup& setup,
                                            bool is_estimated);

}  // namespace heba
