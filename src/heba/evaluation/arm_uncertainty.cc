#include "heba/evaluation/arm_uncertainty.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "heba/evaluation/pose_correction.h"
#include "heba/robot/arm_errors.h"

namespace heba {
namespace {

// A mean of squares.
struct SquaredSum {
  double sum = 0;
  int num = 0;

  void Add(double square) {
    sum += square;
    ++num;
  }
  std::optional<double> Root() const { return num > 0 ? std::optional(std::sqrt(sum / num)) : std::nullopt; }
};

Outcome<std::vector<Eigen::VectorXd>> PosturesAt(const RobotSummary& robot, const Rigid3d& stated) {
  return PosturesOf(robot.nominal, stated * Inverse(robot.tip_from_gripper));
}

// Returns the joints at the mean pose of the captures, in their configuration if all are in one.
std::optional<Eigen::VectorXd> JointsAtMean(const RobotSummary& robot, const Rigid3d& mean) {
  const Outcome<Eigen::VectorXd> joints = JointsAt(robot, mean);
  if (joints) return *joints;
  if (!robot.configuration.empty()) return std::nullopt;
  const Outcome<std::vector<Eigen::VectorXd>> postures = PosturesAt(robot, mean);
  return postures ? std::optional(postures->front()) : std::nullopt;
}

}  // namespace

StatedPose WithArmErrors(const RobotSummary& robot, const Rigid3d& stated, const Eigen::VectorXd& joints) {
  return {stated, MakeArmEffect(robot.nominal, joints, robot.tip_from_gripper)};
}

Outcome<StatedPose> WithArmErrors(const RobotSummary& robot, const Rigid3d& stated) {
  const Outcome<Eigen::VectorXd> joints = JointsAt(robot, stated);
  if (!joints) return Failure{joints.reason()};
  return WithArmErrors(robot, stated, *joints);
}

Eigen::Matrix3d GripperCovariance(Setup setup, const Solution& solution, const StatedPose& stated) {
  const CorrectedPose gripper = Correct(solution, stated);
  const bool is_camera_fixed = setup == Setup::kEyeToHand;
  const Rigid3d& fixed =
      is_camera_fixed ? solution.hand_eye.camera_mount_from_camera : solution.hand_eye.target_mount_from_target;
  const UnknownBlock block = solution.covariance.layout.Block(is_camera_fixed ? kHandEyeBlock : kBoardBlock);
  Eigen::MatrixXd by_unknowns = gripper.base_from_mount.RotationMatrix() * gripper.by_unknowns.topRows<3>();
  if (block.size == 6) {
    const Eigen::Vector3d in_fixed = Inverse(fixed) * gripper.base_from_mount.translation;
    by_unknowns.middleCols<6>(block.first) -= fixed.RotationMatrix() * PointByMotion(in_fixed);
  }
  return by_unknowns * solution.covariance.matrix * by_unknowns.transpose();
}

double SigmaM(const Eigen::Matrix3d& covariance_m2) { return std::sqrt(covariance_m2.trace() / 3); }

std::optional<ConfigurationSigmas> SigmasByConfiguration(Setup setup, const Solution& solution,
                                                         const RobotSummary& robot,
                                                         const std::vector<Rigid3d>& base_from_gripper) {
  if (robot.configuration.empty()) return std::nullopt;
  // The search for postures takes some milliseconds per pose.
  constexpr size_t kMostPoses = 12;
  const size_t step = (base_from_gripper.size() + kMostPoses - 1) / kMostPoses;
  SquaredSum captured;
  SquaredSum others;
  std::array<SquaredSum, 3> flipped;
  for (size_t i = 0; i < base_from_gripper.size(); i += step) {
    const Rigid3d& stated = base_from_gripper[i];
    const Outcome<Eigen::VectorXd> joints = JointsAt(robot, stated);
    const Outcome<std::vector<Eigen::VectorXd>> postures = PosturesAt(robot, stated);
    if (!joints || !postures) continue;
    const Configuration common = *ConfigurationOf(robot.nominal, *joints);
    for (const Eigen::VectorXd& posture : *postures) {
      const std::optional<Configuration> configuration = ConfigurationOf(robot.nominal, posture);
      if (!configuration) continue;
      const double variance_m2 =
          std::pow(SigmaM(GripperCovariance(setup, solution, WithArmErrors(robot, stated, posture))), 2);
      std::vector<size_t> flips;
      for (size_t k = 0; k < 3; ++k) {
        if ((*configuration)[k] != common[k]) flips.push_back(k);
      }
      (flips.empty() ? captured : others).Add(variance_m2);
      if (flips.size() == 1) flipped[flips.front()].Add(variance_m2);
    }
  }
  if (!captured.Root()) return std::nullopt;
  ConfigurationSigmas sigmas{*captured.Root(), {}, others.Root()};
  for (size_t k = 0; k < 3; ++k) sigmas.flipped_m[k] = flipped[k].Root();
  return sigmas;
}

std::optional<ArmMap> MapArm(Setup setup, const Solution& solution, const RobotSummary& robot,
                             const std::vector<Rigid3d>& base_from_gripper, int vertical_axis) {
  if (base_from_gripper.empty()) return std::nullopt;
  const Rigid3d mean = MeanPose(base_from_gripper);
  const std::optional<Eigen::VectorXd> start = JointsAtMean(robot, mean);
  if (!start) return std::nullopt;
  const std::optional<Configuration> configuration = ConfigurationOf(robot.nominal, *start);
  ArmMap map;
  map.vertical_axis = vertical_axis;
  if (configuration) map.configuration = NameOf(*configuration);
  for (const Rigid3d& pose : base_from_gripper) map.captures_m.push_back(pose.translation);
  // No position is farther from the base than the links are long.
  double reach_m = robot.tip_from_gripper.translation.norm() + robot.nominal.base_from_first.translation.norm();
  for (const ArmJoint& joint : robot.nominal.joints) reach_m += std::hypot(joint.a_m, joint.d_m);
  constexpr int kMostCells = 20;
  map.step_m = 2 * reach_m / kMostCells;
  map.first_m = mean.translation;
  for (const int axis : {0, vertical_axis}) {
    // The middle of a cell is at the mean position.
    map.first_m[axis] -= map.step_m * std::floor((mean.translation[axis] + reach_m) / map.step_m);
  }
  const auto position_of = [&](int column, int row) {
    Eigen::Vector3d position = map.first_m;
    position[0] += column * map.step_m;
    position[vertical_axis] += row * map.step_m;
    return position;
  };
  // The joints of a cell are found from those of a cell beside it, beginning at the mean pose.
  std::map<std::pair<int, int>, Eigen::VectorXd> joints_of;
  const auto visit = [&](int column, int row, const Eigen::VectorXd& near) {
    if (column < 0 || row < 0 || column >= kMostCells || row >= kMostCells) return false;
    if (joints_of.contains({column, row})) return false;
    const Rigid3d stated(mean.rotation, position_of(column, row));
    const Outcome<Eigen::VectorXd> joints = PostureNear(robot.nominal, stated * Inverse(robot.tip_from_gripper), near);
    if (!joints || ConfigurationOf(robot.nominal, *joints) != configuration) return false;
    joints_of[{column, row}] = *joints;
    const StatedPose with_errors = WithArmErrors(robot, stated, *joints);
    const double correction_m = DistanceM(Correct(solution, with_errors).base_from_mount, stated);
    map.cells.push_back({column, row, correction_m, SigmaM(GripperCovariance(setup, solution, with_errors))});
    return true;
  };
  const auto cell_at = [&](int axis) {
    return static_cast<int>(std::lround((mean.translation[axis] - map.first_m[axis]) / map.step_m));
  };
  if (!visit(cell_at(0), cell_at(vertical_axis), *start)) return std::nullopt;
  for (size_t next = 0; next < map.cells.size(); ++next) {
    const int column = map.cells[next].column;
    const int row = map.cells[next].row;
    const Eigen::VectorXd near = joints_of[{column, row}];
    for (const auto& [right, up] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
      visit(column + right, row + up, near);
    }
  }
  return map;
}

}  // namespace heba
