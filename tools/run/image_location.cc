#include "tools/run/image_location.h"

#include <cmath>

#include "heba/base/text.h"
#include "heba/evaluation/arm_uncertainty.h"
#include "heba/evaluation/pose_correction.h"
#include "heba/robot/arm_postures.h"

namespace heba {
namespace {

constexpr const char* kNotKnown = "the position or its uncertainty is not a finite number; do not use this result";

// Returns whether the figures of a position can be shown. The covariance in a result file may be invalid.
bool IsKnown(const Eigen::Vector3d& place_m, const PositionCovariance& covariance) {
  const Eigen::Vector3d variances = covariance.TotalM2().diagonal();
  return place_m.allFinite() && variances.allFinite() && variances.minCoeff() >= 0;
}

std::string NameOfConfiguration(const RobotSummary& robot, const Eigen::VectorXd& joints) {
  const std::optional<Configuration> configuration = ConfigurationOf(robot.nominal, joints);
  return configuration ? NameOf(*configuration) : "";
}

ReachCommand CommandNear(Setup setup, const RobotSummary& robot, const Solution& solution, const LocatedTarget& located,
                         const Eigen::VectorXd& near) {
  ReachCommand found;
  const Outcome<Rigid3d> command = CommandFor(robot, located.world_from_target, near);
  if (!command) {
    found.reason = command.reason();
    return found;
  }
  const Outcome<Eigen::VectorXd> joints = PostureNear(robot.nominal, *command * Inverse(robot.tip_from_gripper), near);
  if (!joints) {
    found.reason = joints.reason();
    return found;
  }
  found.base_from_gripper = *command;
  found.joints = *joints;
  found.configuration = NameOfConfiguration(robot, *joints);
  found.covariance = CovarianceOfReach(setup, solution, located, WithArmErrors(robot, *command, *joints));
  return found;
}

// Returns the flange pose that points at a plane: its z axis opposes the normal, its x axis is as close to the base's
// x axis as possible (to the base's y axis if the normal is nearly along x).
Rigid3d PointingAt(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  const Eigen::Vector3d z = -normal;
  const bool is_along_x = std::abs(z.x()) > 0.9;
  const Eigen::Vector3d other = is_along_x ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d x = (other - other.dot(z) * z).normalized();
  Eigen::Matrix3d rotation;
  rotation << x, z.cross(x), z;
  return Rigid3d(rotation, point);
}

// Sets the pixels of `location`, or its fault.
void LocatePixels(const LocationRequest& request, const Solution& solution, const Detection& detection,
                  ImageLocation* location) {
  const Setup setup = request.result->setup;
  const std::optional<Plane>& plane = request.plane;
  const Observations observations = ObservationsOf(*request.target, detection);
  Eigen::Vector3d normal = plane ? plane->normal : Eigen::Vector3d::Zero();
  if (!plane) {
    const Outcome<LocatedTarget> target = LocateTarget(setup, solution, observations, request.camera_mount);
    if (!target) {
      location->fault = detection.reason.empty() ? target.reason() : detection.reason;
      return;
    }
    // The normal on the side that the camera sees.
    normal = target->world_from_target.rotation * Eigen::Vector3d::UnitZ();
  }
  const Rigid3d base_from_camera =
      Correct(solution, request.camera_mount).base_from_mount * solution.hand_eye.camera_mount_from_camera;
  std::vector<PixelPosition> positions;
  for (const Eigen::Vector2d& pixel : request.pixels) {
    const Outcome<LocatedPoint> located =
        plane ? LocatePixel(setup, solution, pixel, *plane, request.camera_mount)
              : LocatePixelOnTarget(setup, solution, pixel, observations, request.camera_mount);
    if (!located || !IsKnown(located->in_world, located->covariance)) {
      location->fault =
          located ? kNotKnown
                  : "pixel " + Significant(pixel.x(), 6) + ", " + Significant(pixel.y(), 6) + ": " + located.reason();
      return;
    }
    PixelPosition position{pixel, *located, {}};
    if (request.arm) {
      const bool is_seen_side = normal.dot(base_from_camera.translation - located->in_world) > 0;
      position.postures =
          FindPostures(*request.arm, PointingAt(located->in_world, is_seen_side ? normal : Eigen::Vector3d(-normal)));
    }
    positions.push_back(std::move(position));
  }
  location->pixels = std::move(positions);
}

PoseSigmas SigmasOf(const Eigen::Matrix3d& position_m2, const Eigen::Matrix3d& rotation_rad2) {
  return {position_m2.diagonal().cwiseSqrt(), rotation_rad2.diagonal().cwiseSqrt()};
}

}  // namespace

ReachingPostures FindPostures(const ReachingArm& arm, const Rigid3d& base_from_tip) {
  ReachingPostures found;
  found.arm = arm.name;
  if (arm.ur != nullptr) {
    for (int joint = 1; joint <= 6; ++joint) found.joint_names.push_back("joint" + std::to_string(joint));
    found.are_turning.assign(found.joint_names.size(), true);
    const Outcome<std::vector<UrPosture>> postures = PosturesOf(*arm.ur, base_from_tip);
    if (!postures) {
      found.reason = postures.reason();
      return found;
    }
    for (const UrPosture& posture : *postures) {
      found.postures.push_back({{posture.joints_rad.begin(), posture.joints_rad.end()}, posture.singularity});
    }
    return found;
  }
  found.is_urdf = true;
  found.joint_names = arm.urdf->joint_names();
  for (size_t i = 0; i < found.joint_names.size(); ++i) found.are_turning.push_back(arm.urdf->IsTurning(i));
  const Outcome<std::vector<std::vector<double>>> postures = arm.urdf->PosturesOf(base_from_tip);
  if (!postures) {
    found.reason = postures.reason();
    return found;
  }
  for (const std::vector<double>& joints : *postures) found.postures.push_back({joints, ""});
  return found;
}

Reach FindReach(Setup setup, const RobotSummary& robot, const Solution& solution, const LocatedTarget& located,
                bool in_each) {
  Reach reach;
  reach.captured_configuration = robot.configuration;
  reach.wanted = located.world_from_target;
  if (!robot.configuration.empty()) {
    const Outcome<Eigen::VectorXd> joints = JointsAt(robot, reach.wanted);
    reach.command = ReachCommand();
    if (joints) {
      reach.command = CommandNear(setup, robot, solution, located, *joints);
    } else {
      reach.command->reason = joints.reason();
    }
    reach.command->is_extrapolated =
        reach.command->reason.empty() && reach.command->configuration != robot.configuration;
  }
  reach.has_each = in_each || robot.configuration.empty();
  if (!reach.has_each) return reach;
  const Outcome<std::vector<Eigen::VectorXd>> postures =
      PosturesOf(robot.nominal, reach.wanted * Inverse(robot.tip_from_gripper));
  if (!postures) {
    reach.reason_of_each = postures.reason();
    return reach;
  }
  for (const Eigen::VectorXd& posture : *postures) {
    ReachCommand command = CommandNear(setup, robot, solution, located, posture);
    command.configuration = NameOfConfiguration(robot, posture);
    command.is_extrapolated =
        command.reason.empty() && !robot.configuration.empty() && command.configuration != robot.configuration;
    reach.in_each.push_back(std::move(command));
  }
  return reach;
}

NearPoses CompareToRough(const std::vector<Rigid3d>& possible, const Rigid3d& rough) {
  NearPoses near;
  for (const Rigid3d& pose : possible) {
    near.angles_rad.push_back(AngleRad(pose, rough));
    near.distances_m.push_back(DistanceM(pose, rough));
  }
  near.least_distance_m = LeastDistanceM(possible);
  return near;
}

std::optional<size_t> ChoosePose(const std::vector<Rigid3d>& possible, const std::optional<Rigid3d>& rough) {
  if (possible.size() == 1) return 0;
  return rough ? FindMeantPose(possible, *rough) : std::nullopt;
}

ImageLocation LocateInImage(const LocationRequest& request, const std::string& image, const Detection& detection) {
  const Solution& solution = *FindRefined(*request.result)->solution;
  ImageLocation location;
  location.image = image;
  location.num_points = detection.ids.size();
  location.num_target_points = request.target->points().size();
  if (!request.pixels.empty()) {
    LocatePixels(request, solution, detection, &location);
    return location;
  }
  const Outcome<std::vector<LocatedTarget>> possible =
      LocateSymmetricTarget(request.result->setup, solution, ObservationsOf(*request.target, detection),
                            request.target->Symmetries(), request.camera_mount);
  if (!possible) {
    location.fault = detection.reason.empty() ? possible.reason() : detection.reason;
    return location;
  }
  for (const LocatedTarget& located : *possible) {
    if (IsKnown(located.world_from_target.translation, located.covariance)) continue;
    location.fault = kNotKnown;
    return location;
  }
  std::vector<Rigid3d> poses;
  for (const LocatedTarget& located : *possible) {
    PossiblePose pose{located, {}};
    if (request.arm) pose.postures = FindPostures(*request.arm, located.world_from_target);
    location.possible.push_back(std::move(pose));
    poses.push_back(located.world_from_target);
  }
  if (request.near) location.near = CompareToRough(poses, *request.near);
  location.chosen = ChoosePose(poses, request.near);
  const bool is_corrected = request.result->setup == Setup::kEyeToHand || request.camera_mount.effect != nullptr;
  if (location.chosen && request.robot != nullptr && is_corrected) {
    location.reach = FindReach(request.result->setup, *request.robot, solution, (*possible)[*location.chosen],
                               request.arm.has_value());
  }
  return location;
}

PoseSigmasBySource SigmasOf(const Solution& solution, const LocatedTarget& located) {
  const PoseUncertainty& uncertainty = located.uncertainty;
  const Eigen::MatrixXd by_unknowns = uncertainty.by_unknowns.bottomRows<3>();
  const Eigen::Matrix3d by_calibration = by_unknowns * solution.covariance.matrix * by_unknowns.transpose();
  const Eigen::Matrix3d by_image = uncertainty.by_image.bottomRightCorner<3, 3>();
  const Eigen::Matrix3d by_robot = uncertainty.ByRobot().bottomRightCorner<3, 3>();
  const PositionCovariance& position = located.covariance;
  return {SigmasOf(position.TotalM2(), by_calibration + by_image + by_robot),
          SigmasOf(position.by_calibration_m2, by_calibration), SigmasOf(position.by_image_m2, by_image),
          SigmasOf(position.by_robot_m2, by_robot)};
}

}  // namespace heba
