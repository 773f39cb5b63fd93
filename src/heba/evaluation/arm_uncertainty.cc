#include "heba/evaluation/arm_uncertainty.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "heba/base/text.h"
#include "heba/base/units.h"
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

// A slice through the workspace: positions of the gripper on a grid, in the orientation of a mean pose, at which the
// cell (0, 0) is.
struct Slice {
  const RobotSummary& robot;
  Rigid3d mean;
  int vertical_axis = 1;
  double step_m = 0;

  Rigid3d PoseAt(int column, int row) const {
    Rigid3d pose = mean;
    pose.translation[0] += column * step_m;
    pose.translation[vertical_axis] += row * step_m;
    return pose;
  }
};

// Returns derivatives plus `sign` times that of a point by the unknowns of a pose, for a point that is fixed to the
// frame of that pose, along the axes of the parent. A block without unknowns adds nothing.
Eigen::MatrixXd WithMotion(Eigen::MatrixXd by_unknowns, double sign, const Rigid3d& parent_from_frame,
                           const Eigen::Vector3d& in_parent, const UnknownBlock& block) {
  if (block.size != 6) return by_unknowns;
  by_unknowns.middleCols<6>(block.first) +=
      sign * parent_from_frame.RotationMatrix() * PointByMotion(Inverse(parent_from_frame) * in_parent);
  return by_unknowns;
}

struct SliceCell {
  int column = 0;
  int row = 0;
  Eigen::VectorXd joints;
};

// Returns the cells that the arm reaches without leaving the configuration of `start`, the joints at the mean pose. The
// joints of a cell are found from those of a cell beside it.
std::vector<SliceCell> ReachedCells(const Slice& slice, const Eigen::VectorXd& start) {
  const RobotSummary& robot = slice.robot;
  const std::optional<Configuration> configuration = ConfigurationOf(robot.nominal, start);
  std::vector<SliceCell> cells = {{0, 0, start}};
  std::set<std::pair<int, int>> known = {{0, 0}};
  constexpr size_t kMost = size_t{ArmMap::kMostCells} * ArmMap::kMostCells;
  for (size_t next = 0; next < cells.size(); ++next) {
    for (const auto& [right, up] : {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
      const SliceCell& from = cells[next];
      const int column = from.column + right;
      const int row = from.row + up;
      if (cells.size() >= kMost || known.contains({column, row})) continue;
      const Outcome<Eigen::VectorXd> joints =
          PostureNear(robot.nominal, slice.PoseAt(column, row) * Inverse(robot.tip_from_gripper), from.joints);
      if (!joints || ConfigurationOf(robot.nominal, *joints) != configuration) continue;
      known.insert({column, row});
      cells.push_back({column, row, *joints});
    }
  }
  return cells;
}

}  // namespace

StatedPose WithArmErrors(const RobotSummary& robot, const Rigid3d& stated, const Eigen::VectorXd& joints) {
  return {stated, MakeArmEffect(robot.nominal, joints, robot.tip_from_gripper),
          GripperByJoints(robot.nominal, joints, robot.tip_from_gripper)};
}

Outcome<StatedPose> WithArmErrors(const RobotSummary& robot, const Rigid3d& stated) {
  const Outcome<Eigen::VectorXd> joints = JointsAt(robot, stated);
  if (!joints) return joints.failure();
  return WithArmErrors(robot, stated, *joints);
}

Outcome<StatedPose> WithErrorsOfArm(const RobotSummary* robot, const Rigid3d& stated,
                                    const std::optional<Eigen::VectorXd>& joints) {
  if (robot == nullptr) {
    if (joints) return Failure{"the run has not estimated the errors of an arm; leave them out"};
    return StatedPose(stated);
  }
  if (!joints) return WithArmErrors(*robot, stated);
  if (joints->size() != robot->nominal.num_joints()) {
    return Failure{"there are " + std::to_string(joints->size()) + ", but the arm " + robot->nominal.name + " has " +
                   std::to_string(robot->nominal.num_joints())};
  }
  const Outcome<Rigid3d> is_near = TruePose(*robot, stated, *joints);
  if (!is_near) return is_near.failure();
  return WithArmErrors(*robot, stated, *joints);
}

GripperLocator LocatorOf(Setup setup, const PairSolution& solution) {
  const bool is_camera_fixed = setup == Setup::kEyeToHand;
  const Rigid3d& fixed =
      is_camera_fixed ? solution.hand_eye.camera_mount_from_camera : solution.hand_eye.target_mount_from_target;
  const UnknownBlock block = solution.covariance.layout.Block(is_camera_fixed ? kHandEyeBlock : kBoardBlock);
  return [&solution, fixed, block](const StatedPose& stated) {
    const CorrectedPose gripper = Correct(solution, stated);
    const Rigid3d& pose = gripper.base_from_mount;
    const Eigen::MatrixXd by_unknowns =
        WithMotion(pose.RotationMatrix() * gripper.by_unknowns.topRows<3>(), -1, fixed, pose.translation, block);
    return LocatedGripper{pose, by_unknowns * solution.covariance.matrix * by_unknowns.transpose()};
  };
}

std::string FixedPart::Name(const Problem& rig) const {
  return kind == Kind::kCamera ? "camera " + rig.cameras[index].name : "target " + rig.targets[index].name;
}

std::optional<FixedPart> FindFixedPart(const Problem& rig) {
  const auto is_fixed = [](const auto& part) { return part.mount.part == Mount::Part::kBase; };
  const auto camera = std::find_if(rig.cameras.begin(), rig.cameras.end(), is_fixed);
  if (camera != rig.cameras.end()) {
    return FixedPart{FixedPart::Kind::kCamera, static_cast<size_t>(camera - rig.cameras.begin())};
  }
  const auto target = std::find_if(rig.targets.begin(), rig.targets.end(), is_fixed);
  if (target == rig.targets.end()) return std::nullopt;
  return FixedPart{FixedPart::Kind::kTarget, static_cast<size_t>(target - rig.targets.begin())};
}

GripperLocator LocatorOf(const Problem& rig, const Solution& solution, size_t robot, const FixedPart& fixed) {
  const UnknownLayout& layout = solution.covariance.layout;
  const bool is_camera = fixed.kind == FixedPart::Kind::kCamera;
  const size_t base = is_camera ? rig.cameras[fixed.index].mount.robot : rig.targets[fixed.index].mount.robot;
  const Rigid3d& world_from_base = solution.poses.world_from_base[base];
  const Rigid3d world_from_fixed = world_from_base * (is_camera ? solution.poses.mount_from_camera[fixed.index]
                                                                : solution.poses.mount_from_target[fixed.index]);
  const UnknownBlock of_fixed =
      layout.Block(is_camera ? CameraPoseBlock(rig.cameras[fixed.index]) : TargetPoseBlock(rig.targets[fixed.index]));
  // The first base is the world, and has no unknowns.
  const UnknownBlock of_base = layout.Block(BaseBlock(rig.robots[base]));
  const UnknownBlock of_own_base = layout.Block(BaseBlock(rig.robots[robot]));
  return [&rig, &solution, robot, world_from_base, world_from_fixed, of_fixed, of_base,
          of_own_base](const StatedPose& stated) {
    const CorrectedPose gripper = Correct(rig, solution, robot, stated);
    const Rigid3d& world_from_own = solution.poses.world_from_base[robot];
    const Rigid3d pose = world_from_own * gripper.base_from_mount;
    Eigen::MatrixXd by_unknowns = pose.RotationMatrix() * gripper.by_unknowns.topRows<3>();
    by_unknowns = WithMotion(std::move(by_unknowns), 1, world_from_own, pose.translation, of_own_base);
    by_unknowns = WithMotion(std::move(by_unknowns), -1, world_from_base, pose.translation, of_base);
    by_unknowns = WithMotion(std::move(by_unknowns), -1, world_from_fixed, pose.translation, of_fixed);
    return LocatedGripper{gripper.base_from_mount, by_unknowns * solution.covariance.matrix * by_unknowns.transpose()};
  };
}

// A variance that is zero may be negative by rounding.
double SigmaM(const Eigen::Matrix3d& covariance_m2) { return std::sqrt(std::max(0.0, covariance_m2.trace() / 3)); }

std::optional<ConfigurationSigmas> SigmasByConfiguration(const GripperLocator& locate, const RobotSummary& robot,
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
      const double variance_m2 = std::pow(SigmaM(locate(WithArmErrors(robot, stated, posture)).covariance_m2), 2);
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

std::optional<ArmMap> MapArm(const GripperLocator& locate, const RobotSummary& robot,
                             const std::vector<Rigid3d>& base_from_gripper, int vertical_axis) {
  if (base_from_gripper.empty()) return std::nullopt;
  const Rigid3d mean = MeanPose(base_from_gripper);
  const std::optional<Eigen::VectorXd> start = JointsAtMean(robot, mean);
  if (!start) return std::nullopt;
  // No position is farther from the base than the links are long.
  double reach_m = robot.tip_from_gripper.translation.norm() + robot.nominal.base_from_first.translation.norm();
  for (const ArmJoint& joint : robot.nominal.joints) reach_m += std::hypot(joint.a_m, joint.d_m);
  // The extent of the positions in reach, from wide cells, determines the size of the map's.
  const Slice wide{robot, mean, vertical_axis, 2 * reach_m / ArmMap::kMostCells};
  int extent = 1;
  const std::vector<SliceCell> reached = ReachedCells(wide, *start);
  for (const SliceCell& a : reached) {
    for (const SliceCell& b : reached) extent = std::max({extent, a.column - b.column + 1, a.row - b.row + 1});
  }
  // The map may continue by less than a wide cell at both sides.
  const Slice slice{robot, mean, vertical_axis, wide.step_m * (extent + 2) / ArmMap::kMostCells};
  ArmMap map;
  map.vertical_axis = vertical_axis;
  map.mean_m = mean.translation;
  map.step_m = slice.step_m;
  const std::optional<Configuration> configuration = ConfigurationOf(robot.nominal, *start);
  if (configuration) map.configuration = NameOf(*configuration);
  for (const Rigid3d& pose : base_from_gripper) map.captures_m.push_back(pose.translation);
  for (const SliceCell& cell : ReachedCells(slice, *start)) {
    const Rigid3d stated = slice.PoseAt(cell.column, cell.row);
    const LocatedGripper gripper = locate(WithArmErrors(robot, stated, cell.joints));
    map.cells.push_back(
        {stated.translation, DistanceM(gripper.base_from_gripper, stated), SigmaM(gripper.covariance_m2)});
  }
  return map;
}

std::vector<std::string> ImplausibleErrors(const RobotSummary& robot) {
  constexpr double kSigmas = 4;
  constexpr double kMostOffsetDeg = 5;
  std::vector<std::string> implausible;
  for (Eigen::Index place = 0; place < robot.errors.size(); ++place) {
    const ArmParam param = ParamAt(place);
    const std::string_view unit = ArmParamUnit(robot.nominal, static_cast<int>(place));
    const bool is_length = unit == "m";
    if (param == ArmParam::kCompliance || !(is_length || unit == "rad")) continue;
    const double most = is_length                   ? kSigmas * kMostLengthM
                        : param == ArmParam::kTheta ? DegToRad(kMostOffsetDeg)
                                                    : DegToRad(kSigmas * kMostAngleDeg);
    if (std::abs(robot.errors[place]) <= most) continue;
    const double shown = is_length ? 1000 * robot.errors[place] : RadToDeg(robot.errors[place]);
    implausible.push_back(ArmParamName(static_cast<int>(place)) + (shown > 0 ? " +" : " ") + Significant(shown, 2) +
                          (is_length ? " mm" : " deg"));
  }
  return implausible;
}

}  // namespace heba
