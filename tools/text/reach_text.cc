#include "tools/text/reach_text.h"

#include <cmath>
#include <optional>
#include <vector>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/arm_uncertainty.h"
#include "heba/evaluation/pose_correction.h"
#include "heba/robot/arm_postures.h"
#include "tools/text/result_text.h"

namespace heba {
namespace {

std::string SigmasMm(const Eigen::Matrix3d& covariance_m2) {
  std::vector<std::string> parts;
  for (int i = 0; i < 3; ++i) parts.push_back(Significant(1000 * std::sqrt(covariance_m2(i, i)), 2));
  return Join(parts, ", ");
}

std::string DifferenceText(const Rigid3d& a, const Rigid3d& b) {
  return Significant(1000 * DistanceM(a, b), 3) + " mm and " + Significant(RadToDeg(AngleRad(a, b)), 3) + " deg";
}

// A pose to command and the joints at which the controller reports it.
struct Command {
  Rigid3d base_from_gripper;
  Eigen::VectorXd joints;
};

Outcome<Command> CommandNear(const RobotSummary& robot, const Rigid3d& wanted, const Eigen::VectorXd& near) {
  const Outcome<Rigid3d> command = CommandFor(robot, wanted, near);
  if (!command) return Failure{command.reason()};
  const Outcome<Eigen::VectorXd> joints = PostureNear(robot.nominal, *command * Inverse(robot.tip_from_gripper), near);
  if (!joints) return Failure{joints.reason()};
  return Command{*command, *joints};
}

std::string NameOfConfiguration(const RobotSummary& robot, const Eigen::VectorXd& joints) {
  const std::optional<Configuration> configuration = ConfigurationOf(robot.nominal, joints);
  return configuration ? NameOf(*configuration) : "";
}

PositionCovariance CovarianceAt(const RobotSummary& robot, const Solution& solution, const LocatedTarget& located,
                                const Command& command) {
  return CovarianceOfReach(solution, located, WithArmErrors(robot, command.base_from_gripper, command.joints));
}

std::string InAllConfigurations(const RobotSummary& robot, const Solution& solution, const LocatedTarget& located) {
  const Rigid3d& wanted = located.base_from_target;
  const Outcome<std::vector<Eigen::VectorXd>> postures =
      PosturesOf(robot.nominal, wanted * Inverse(robot.tip_from_gripper));
  if (!postures) return "  no pose to command: " + postures.reason() + "\n";
  std::string text = "  poses to command in each configuration, with one sigma of the gripper against the target:\n";
  for (const Eigen::VectorXd& posture : *postures) {
    const Outcome<Command> command = CommandNear(robot, wanted, posture);
    const std::string name = NameOfConfiguration(robot, posture);
    text += "    " + (name.empty() ? "" : name + ": ");
    if (!command) {
      text += command.reason() + "\n";
      continue;
    }
    const PositionCovariance covariance = CovarianceAt(robot, solution, located, *command);
    text += PoseText(command->base_from_gripper) + "; " + SigmasMm(covariance.TotalM2()) + " mm";
    const bool is_other = !robot.configuration.empty() && name != robot.configuration;
    text += std::string(is_other ? "; no capture is in this configuration, so that the arm's errors are extrapolated"
                                 : "") +
            "\n";
  }
  return text;
}

}  // namespace

std::string SigmasText(const PositionCovariance& covariance) {
  return SigmasMm(covariance.TotalM2()) + " mm (calibration " + SigmasMm(covariance.by_calibration_m2) + "; image " +
         SigmasMm(covariance.by_image_m2) +
         (covariance.by_robot_m2.isZero() ? "" : "; robot " + SigmasMm(covariance.by_robot_m2)) + ")";
}

std::string CorrectionText(const RobotSummary& robot, const Solution& solution, const StatedPose& stated) {
  return "  the robot's pose was corrected by the estimated errors of the arm " + robot.nominal.name + ", by " +
         DifferenceText(stated.base_from_mount, Correct(solution, stated).base_from_mount) + "\n";
}

std::string ReachText(const RobotSummary& robot, const Solution& solution, const LocatedTarget& located,
                      bool all_configurations) {
  if (robot.configuration.empty()) return InAllConfigurations(robot, solution, located);
  const Rigid3d& wanted = located.base_from_target;
  const Outcome<Eigen::VectorXd> joints = JointsAt(robot, wanted);
  const Outcome<Command> command = joints ? CommandNear(robot, wanted, *joints) : Failure{joints.reason()};
  std::string text;
  if (!command) {
    text = "  no pose to command: " + command.reason() + "\n";
  } else {
    text = "  pose to command so that the gripper truly reaches it, " +
           DifferenceText(command->base_from_gripper, wanted) + " from it: base_from_gripper " +
           PoseText(command->base_from_gripper) +
           "\n  one sigma of the gripper against the target, along the base's x, y, z: " +
           SigmasText(CovarianceAt(robot, solution, located, *command)) + "\n";
    if (NameOfConfiguration(robot, command->joints) != robot.configuration) {
      text += "  the pose to command is not in the configuration of the captures (" + robot.configuration +
              "), so that the arm's errors are extrapolated\n";
    }
  }
  return text + (all_configurations ? InAllConfigurations(robot, solution, located) : "");
}

}  // namespace heba
