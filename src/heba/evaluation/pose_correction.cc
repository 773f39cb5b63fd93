#include "heba/evaluation/pose_correction.h"

#include <optional>
#include <vector>

#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/robot/arm_errors.h"
#include "heba/robot/arm_postures.h"

namespace heba {

Outcome<Eigen::VectorXd> JointsAt(const RobotSummary& robot, const Rigid3d& reported) {
  const Outcome<std::vector<Eigen::VectorXd>> postures =
      PosturesOf(robot.nominal, reported * Inverse(robot.tip_from_gripper));
  if (!postures) return postures.failure();
  if (robot.configuration.empty()) {
    return Failure{"the captures are in several configurations of the arm, so that a pose does not tell its joints"};
  }
  for (const Eigen::VectorXd& posture : *postures) {
    const std::optional<Configuration> configuration = ConfigurationOf(robot.nominal, posture);
    if (configuration && NameOf(*configuration) == robot.configuration) return posture;
  }
  return Failure{"the arm " + robot.nominal.name + " does not reach the pose in the configuration of the captures (" +
                 robot.configuration + ")"};
}

namespace {

Rigid3d TruePoseAt(const RobotSummary& robot, const Rigid3d& reported, const Eigen::VectorXd& joints) {
  return reported * MakeArmEffect(robot.nominal, joints, robot.tip_from_gripper)->Evaluate(robot.errors, nullptr);
}

}  // namespace

Outcome<Rigid3d> TruePose(const RobotSummary& robot, const Rigid3d& reported) {
  const Outcome<Eigen::VectorXd> joints = JointsAt(robot, reported);
  if (!joints) return joints.failure();
  return TruePoseAt(robot, reported, *joints);
}

Outcome<Rigid3d> TruePose(const RobotSummary& robot, const Rigid3d& reported, const Eigen::VectorXd& joints) {
  // A controller with another calibration reports poses that are some millimetres from those of the nominal arm.
  constexpr double kFarM = 0.1;
  const double kFarRad = DegToRad(10);
  const Rigid3d nominal = BaseFromTip(robot.nominal, joints) * robot.tip_from_gripper;
  const double distance_m = DistanceM(nominal, reported);
  const double angle_rad = AngleRad(nominal, reported);
  if (distance_m > kFarM || angle_rad > kFarRad) {
    return Failure{"the joints are not those of the pose: with them, the gripper of the arm " + robot.nominal.name +
                   " is " + Significant(1000 * distance_m, 3) + " mm and " + Significant(RadToDeg(angle_rad), 3) +
                   " deg away from it"};
  }
  return TruePoseAt(robot, reported, joints);
}

Outcome<Rigid3d> CommandFor(const RobotSummary& robot, const Rigid3d& wanted) {
  // At the limit of its reach, the arm with its true parameters may reach a pose that the nominal one does not, and the
  // command for it is within the reach of the latter. The joints at a pose nearby are a start.
  constexpr double kShorter[] = {0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2};
  std::optional<Failure> failure;
  for (const double shorter : kShorter) {
    const Outcome<Eigen::VectorXd> joints =
        JointsAt(robot, Rigid3d(wanted.rotation, (1 - shorter) * wanted.translation));
    if (joints) return CommandFor(robot, wanted, *joints);
    if (!failure) failure = joints.failure();
  }
  return *failure;
}

Outcome<Rigid3d> CommandFor(const RobotSummary& robot, const Rigid3d& wanted, const Eigen::VectorXd& joints_near) {
  Outcome<Eigen::VectorXd> joints = PostureNear(robot.nominal, wanted * Inverse(robot.tip_from_gripper), joints_near);
  // The command may be within reach though the pose is not.
  if (!joints) joints = joints_near;
  // The correction changes little with the pose, so that this iteration gains some three digits with every round.
  constexpr int kMaxRounds = 20;
  constexpr double kExact = 1e-10;
  Rigid3d command = wanted;
  for (int round = 0; round < kMaxRounds; ++round) {
    const Tangent6 missing = LocalCoordinates(TruePoseAt(robot, command, *joints), wanted);
    if (missing.norm() < kExact) return command;
    command = Retract(command, missing);
    Outcome<Eigen::VectorXd> next = PostureNear(robot.nominal, command * Inverse(robot.tip_from_gripper), *joints);
    if (!next) return next.failure();
    joints = std::move(next);
  }
  return Failure{"no command was found that reaches the pose"};
}

}  // namespace heba
