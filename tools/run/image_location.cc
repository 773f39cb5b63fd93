#include "tools/run/image_location.h"

#include <algorithm>
#include <cmath>

#include "heba/base/failure_code.h"
#include "heba/base/rng.h"
#include "heba/base/text.h"
#include "heba/base/units.h"
#include "heba/evaluation/arm_uncertainty.h"
#include "heba/evaluation/pose_correction.h"
#include "heba/robot/arm_postures.h"
#include "heba/target_location.h"

namespace heba {
namespace {

const Failure kNotKnown = FailureCode("not_finite");
constexpr const char* kNotCorrected = "the target was located with a pose that was not corrected";

// Returns whether the figures of a position can be shown. The covariance in a result file may be invalid.
bool IsKnown(const Eigen::Vector3d& position_m, const PositionCovariance& covariance) {
  const Eigen::Vector3d variances = covariance.TotalM2().diagonal();
  return position_m.allFinite() && variances.allFinite() && variances.minCoeff() >= 0;
}

std::vector<StatedPose> StatedPosesOf(const LocationRequest& request) {
  std::vector<StatedPose> poses;
  for (const ArmPose& arm : request.arms) poses.push_back(arm.stated);
  return poses;
}

std::string NameOfConfiguration(const RobotSummary& robot, const Eigen::VectorXd& joints) {
  const std::optional<Configuration> configuration = ConfigurationOf(robot.nominal, joints);
  return configuration ? NameOf(*configuration) : "";
}

// Returns the command near these joints with which arm `robot` brings its gripper to `wanted`, a pose in its base.
ReachCommand CommandNear(const LocationRequest& request, size_t robot, const LocatedTarget& located,
                         const Rigid3d& wanted, const Eigen::VectorXd& near) {
  const RunResult& result = *request.result;
  const RobotSummary& arm = *FindEstimatedArm(result, robot);
  ReachCommand found;
  const Outcome<Rigid3d> command = CommandFor(arm, wanted, near);
  if (!command) {
    found.reason = command.reason();
    return found;
  }
  const Outcome<Eigen::VectorXd> joints = PostureNear(arm.nominal, *command * Inverse(arm.tip_from_gripper), near);
  if (!joints) {
    found.reason = joints.reason();
    return found;
  }
  found.base_from_gripper = *command;
  found.joints = *joints;
  found.configuration = NameOfConfiguration(arm, *joints);
  found.covariance =
      CovarianceOfReachInCell(result.rig, result.solution, robot, located, WithArmErrors(arm, *command, *joints),
                              request.gripper_from_tool.translation, request.target_from_grasp.translation);
  return found;
}

// Finds the pose to command in the configuration of the captures. `in_each`: also in all configurations; they are found
// in any case if those of the captures are several.
TargetReach FindReach(const LocationRequest& request, size_t robot, const LocatedTarget& located, bool in_each) {
  const RunResult& result = *request.result;
  const RobotSummary& arm = *FindEstimatedArm(result, robot);
  TargetReach reach;
  reach.robot = robot;
  reach.captured_configuration = arm.configuration;
  reach.wanted =
      Inverse(result.solution.poses.world_from_base[robot]) * located.world_from_target * request.TargetFromGripper();
  if (!arm.configuration.empty()) {
    const Outcome<Eigen::VectorXd> joints = JointsAt(arm, reach.wanted);
    reach.command = ReachCommand();
    if (joints) {
      reach.command = CommandNear(request, robot, located, reach.wanted, *joints);
    } else {
      reach.command->reason = joints.reason();
    }
    reach.command->is_extrapolated = reach.command->reason.empty() && reach.command->configuration != arm.configuration;
  }
  reach.has_each = in_each || arm.configuration.empty();
  if (!reach.has_each) return reach;
  const Outcome<std::vector<Eigen::VectorXd>> postures =
      PosturesOf(arm.nominal, reach.wanted * Inverse(arm.tip_from_gripper));
  if (!postures) {
    reach.reason = postures.reason();
    return reach;
  }
  for (const Eigen::VectorXd& posture : *postures) {
    ReachCommand command = CommandNear(request, robot, located, reach.wanted, posture);
    command.configuration = NameOfConfiguration(arm, posture);
    command.is_extrapolated =
        command.reason.empty() && !arm.configuration.empty() && command.configuration != arm.configuration;
    reach.in_each.push_back(std::move(command));
  }
  return reach;
}

// Returns the reach by each arm whose errors are estimated. A pose that was not corrected has other errors than these.
std::vector<TargetReach> FindReaches(const LocationRequest& request, const LocatedTarget& located) {
  const bool is_corrected = std::all_of(request.arms.begin(), request.arms.end(),
                                        [](const ArmPose& arm) { return arm.why_not_corrected.empty(); });
  std::vector<TargetReach> reaches;
  for (size_t r = 0; r < request.result->rig.robots.size(); ++r) {
    if (FindEstimatedArm(*request.result, r) == nullptr) continue;
    if (is_corrected) {
      const bool in_each = !request.reaching.empty() && request.reaching[r].has_value();
      reaches.push_back(FindReach(request, r, located, in_each));
    } else {
      TargetReach& reach = reaches.emplace_back();
      reach.robot = r;
      reach.reason = kNotCorrected;
    }
  }
  return reaches;
}

ReachingPostures FindPostures(const ReachingArm& arm, const Rigid3d& base_from_tip) {
  ReachingPostures found;
  found.arm = arm;
  const Outcome<std::vector<Eigen::VectorXd>> postures = PosturesWithinLimits(arm.arm, base_from_tip);
  if (!postures) {
    found.reason = postures.reason();
    return found;
  }
  for (const Eigen::VectorXd& joints : *postures) found.postures.push_back({joints, SingularityAt(arm.arm, joints)});
  return found;
}

// Returns the postures of the arms that the request names.
std::vector<ReachingPostures> FindAllPostures(const LocationRequest& request, const Rigid3d& world_from_tip) {
  std::vector<ReachingPostures> all;
  for (size_t r = 0; r < request.reaching.size(); ++r) {
    if (!request.reaching[r]) continue;
    const Rigid3d& world_from_base = request.result->solution.poses.world_from_base[r];
    all.push_back(FindPostures(*request.reaching[r], Inverse(world_from_base) * world_from_tip));
    all.back().robot = r;
  }
  return all;
}

// Returns the flange pose that points at a plane: its z axis opposes the normal, its x axis is as close to the world's
// x axis as possible (to the world's y axis if the normal is nearly along x).
Rigid3d PointingAt(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  const Eigen::Vector3d z = -normal;
  const bool is_along_x = std::abs(z.x()) > 0.9;
  const Eigen::Vector3d other = is_along_x ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d x = (other - other.dot(z) * z).normalized();
  Eigen::Matrix3d rotation;
  rotation << x, z.cross(x), z;
  return Rigid3d(rotation, point);
}

// Returns the position of a camera in the world.
Eigen::Vector3d PositionOf(const LocationRequest& request, size_t camera) {
  const RunResult& result = *request.result;
  std::vector<Rigid3d> base_from_gripper;
  for (size_t r = 0; r < request.arms.size(); ++r) {
    base_from_gripper.push_back(Correct(result.rig, result.solution, r, request.arms[r].stated).base_from_mount);
  }
  const Mount& mount = result.rig.cameras[camera].mount;
  const CellPoses& poses = result.solution.poses;
  return WorldFromMount(mount, poses.world_from_base, base_from_gripper) * poses.mount_from_camera[camera].translation;
}

// Returns the positions of the pixels. `target`: the one whose plane they are on; null if the request has a plane.
Outcome<std::vector<PixelPosition>> LocatePixels(const LocationRequest& request, const LocatedTarget* target) {
  const Problem& rig = request.result->rig;
  const Solution& solution = request.result->solution;
  const std::vector<StatedPose> poses = StatedPosesOf(request);
  const Eigen::Vector3d normal =
      target == nullptr ? request.plane->normal : target->world_from_target.rotation * Eigen::Vector3d::UnitZ();
  std::vector<PixelPosition> positions;
  for (const CameraPixel& pixel : request.pixels) {
    const Outcome<LocatedPoint> located = target == nullptr
                                              ? LocatePixelInCell(rig, solution, pixel, *request.plane, poses)
                                              : LocatePixelOnTargetInCell(rig, solution, pixel, *target, poses);
    if (!located || !IsKnown(located->in_world, located->covariance)) {
      if (located) return kNotKnown;
      return Failure{FailureCode("of_pixel"),
                     {{"u", pixel.pixel.x()}, {"v", pixel.pixel.y()}},
                     {{"camera", rig.cameras[pixel.camera].name}},
                     {located.failure()}};
    }
    const bool is_seen_side = normal.dot(PositionOf(request, pixel.camera) - located->in_world) > 0;
    const Rigid3d tip = PointingAt(located->in_world, is_seen_side ? normal : Eigen::Vector3d(-normal));
    positions.push_back({pixel, *located, FindAllPostures(request, tip)});
  }
  return positions;
}

// Returns the point that the pixels show together.
Outcome<LocatedPoint> LocatePoint(const LocationRequest& request) {
  Outcome<LocatedPoint> located =
      TriangulateInCell(request.result->rig, request.result->solution, request.pixels, StatedPosesOf(request));
  if (located && !IsKnown(located->in_world, located->covariance)) return kNotKnown;
  return located;
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

// Returns the index of the pose that is meant: the only one, or the one that `rough` is near to (FindMeantPose).
// Returns nothing if that does not decide.
std::optional<size_t> ChoosePose(const std::vector<Rigid3d>& possible, const std::optional<Rigid3d>& rough) {
  if (possible.size() == 1) return 0;
  return rough ? FindMeantPose(possible, *rough) : std::nullopt;
}

// Returns the sightings of a target of which the images show enough points.
std::vector<Sighting> SightingsOf(const LocationRequest& request, const std::vector<Sighting>& sightings,
                                  size_t target) {
  const size_t fewest_points = IsSingleCamera(request.result->rig) ? 0 : 4;
  std::vector<Sighting> seen;
  for (const Sighting& sighting : sightings) {
    if (sighting.target == target && sighting.detection.ids.size() >= fewest_points) seen.push_back(sighting);
  }
  return seen;
}

// Returns what is known of a target without its pose.
TargetLocation Unlocated(size_t target, const std::vector<Sighting>& seen) {
  TargetLocation location;
  location.target = target;
  for (const Sighting& sighting : seen) {
    location.cameras.push_back(sighting.camera);
    location.num_points += sighting.detection.ids.size();
  }
  return location;
}

// Returns a target with the poses that fit its sightings, and the one that is meant.
TargetLocation LocateSeen(TargetLocation location, const LocationRequest& request,
                          const std::vector<Sighting>& sightings) {
  const Problem& rig = request.result->rig;
  const Solution& solution = request.result->solution;
  const std::vector<StatedPose> arms = StatedPosesOf(request);
  std::vector<CameraObservations> seen;
  for (const Sighting& sighting : sightings) {
    seen.push_back({sighting.camera, ObservationsOf(*request.targets[sighting.target], sighting.detection)});
  }
  location.contradiction = FindContradiction(rig, solution, location.target, seen, arms);
  if (location.contradiction) return location;
  const Outcome<std::vector<LocatedTarget>> possible = LocateTargetInCell(rig, solution, location.target, seen, arms);
  if (!possible) {
    location.undetermined = possible.failure();
    return location;
  }
  std::vector<Rigid3d> poses;
  for (const LocatedTarget& located : *possible) {
    if (!IsKnown(located.world_from_target.translation, located.covariance)) location.undetermined = kNotKnown;
    poses.push_back(located.world_from_target);
  }
  if (!location.undetermined.empty()) return location;
  for (const LocatedTarget& located : *possible) location.possible.push_back({located, {}});
  const std::optional<Rigid3d> rough = request.near.empty() ? std::nullopt : request.near[location.target];
  if (rough) location.near = CompareToRough(poses, *rough);
  location.chosen = ChoosePose(poses, rough);
  return location;
}

PoseSigmas SigmasOf(const Eigen::Matrix3d& position_m2, const Eigen::Matrix3d& rotation_rad2) {
  return {position_m2.diagonal().cwiseSqrt(), rotation_rad2.diagonal().cwiseSqrt()};
}

}  // namespace

bool IsSingleCamera(const Problem& rig) { return rig.cameras.size() == 1 && rig.cameras.front().name.empty(); }

bool ImageLocation::IsLocated() const {
  return point || !pixels.empty() || std::any_of(targets.begin(), targets.end(), [](const TargetLocation& target) {
           return target.chosen.has_value();
         });
}

std::vector<ArmPose> PosesForCameras(const RunResult& result, const std::vector<size_t>& cameras,
                                     const std::vector<GivenArmPose>& given, const std::string& pose_name,
                                     const std::string& joints_name) {
  const Problem& rig = result.rig;
  std::vector<ArmPose> arms;
  for (size_t r = 0; r < rig.robots.size(); ++r) {
    const bool is_named = !rig.robots[r].empty();
    const std::string robot = is_named ? "the arm " + rig.robots[r] : "the robot";
    const auto carrier = std::find_if(cameras.begin(), cameras.end(), [&](size_t camera) {
      return rig.cameras[camera].mount == Mount{r, Mount::Part::kGripper};
    });
    ArmPose& arm = arms.emplace_back();
    arm.carries_camera = carrier != cameras.end();
    if (arm.carries_camera && !given[r].base_from_gripper) {
      throw InputError(pose_name + ": " + (is_named ? "camera " + rig.cameras[*carrier].name : "the camera") +
                       " is carried by " + robot + ", whose pose is needed");
    }
    if (!arm.carries_camera && (given[r].base_from_gripper || given[r].joints)) {
      const bool is_pose = given[r].base_from_gripper.has_value();
      throw InputError((is_pose ? pose_name : joints_name) + ": " +
                       (is_named ? robot + " carries none of the cameras" : "the camera is stationary") +
                       "; leave its " + (is_pose ? "pose" : "joints") + " out");
    }
    if (!arm.carries_camera) continue;
    const Outcome<StatedPose> stated =
        WithErrorsOfArm(FindEstimatedArm(result, r), *given[r].base_from_gripper, given[r].joints);
    if (!stated && given[r].joints) {
      throw InputError(joints_name + ": " + (is_named ? "arm " + rig.robots[r] + ": " : "") + stated.reason());
    }
    arm.stated = stated ? *stated : StatedPose(*given[r].base_from_gripper);
    if (!stated) arm.why_not_corrected = stated.reason();
  }
  return arms;
}

ImageLocation LocateInImages(const LocationRequest& request, const std::string& image,
                             const std::vector<Sighting>& sightings) {
  ImageLocation location;
  location.image = image;
  const bool is_on_target = !request.pixels.empty() && !request.plane && !sightings.empty();
  const auto locate_pixels = [&](const LocatedTarget* target) {
    Outcome<std::vector<PixelPosition>> located = LocatePixels(request, target);
    if (!located) location.fault = located.failure();
    if (located) location.pixels = *std::move(located);
  };
  std::vector<TargetLocation> targets;
  for (size_t t = 0; t < request.targets.size(); ++t) {
    const std::vector<Sighting> seen = SightingsOf(request, sightings, t);
    if (seen.empty()) continue;
    TargetLocation target = Unlocated(t, seen);
    if (request.pixels.empty() || is_on_target) target = LocateSeen(std::move(target), request, seen);
    const std::string& why_few = sightings.front().detection.reason;
    if (!target.undetermined.empty() && sightings.size() == 1 && !why_few.empty()) {
      target.undetermined = {FailureCode("few_detected"), {}, {{"why", why_few}}};
    }
    targets.push_back(std::move(target));
  }
  if (targets.empty() && (request.pixels.empty() || is_on_target)) {
    location.fault = FailureCode("no_target");
  } else if (is_on_target) {
    TargetLocation& target = targets.front();
    location.fault = target.undetermined;
    if (!target.possible.empty()) locate_pixels(&target.possible.front().located);
    target.possible.clear();
    target.chosen.reset();
  } else if (request.plane) {
    locate_pixels(nullptr);
  } else if (!request.pixels.empty()) {
    const Outcome<LocatedPoint> located = LocatePoint(request);
    if (!located) location.fault = located.failure();
    if (located) location.point = *located;
  }
  for (TargetLocation& target : targets) {
    for (PossiblePose& pose : target.possible) {
      pose.postures = FindAllPostures(request, pose.located.world_from_target * request.TargetFromGripper());
    }
    if (target.chosen) target.reaches = FindReaches(request, target.possible[*target.chosen].located);
  }
  location.targets = std::move(targets);
  return location;
}

Eigen::Matrix3d CovarianceOfPoint(const LocatedTarget& located, const Eigen::Vector3d& point_in_target) {
  const Eigen::Matrix<double, 3, 6> by_pose =
      located.world_from_target.RotationMatrix() * PointByMotion(point_in_target);
  return by_pose * located.pose_covariance.Total() * by_pose.transpose();
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
