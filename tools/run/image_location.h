// Locates the targets, or pixels, that images of one moment show in the world, with the sigmas and with the joints of
// arms that reach them: all values that `heba locate` states. The images are one of a single camera, whose world is the
// base of its robot, or one of each of several cameras.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/error.h"
#include "heba/detection.h"
#include "heba/evaluation/run_result.h"
#include "heba/location.h"
#include "heba/robot/arm.h"
#include "heba/target.h"

namespace heba {

// Returns whether a problem is that of a single camera, whose parts have no names (heba/data/hand_eye.h).
bool IsSingleCamera(const Problem& rig);

// An arm whose joints are to be found: one of the built-in table, or a URDF's from its root to its only tip.
struct ReachingArm {
  std::string name;  // The name in the table, or the path of the URDF.
  Arm arm;
  std::vector<std::string> joint_names;
};

// The joints with which an arm brings its flange, or the tip of a URDF, to a pose in its base: PosturesWithinLimits.
struct ReachingPostures {
  struct Posture {
    Eigen::VectorXd joints;   // rad or m.
    std::string singularity;  // SingularityAt.
  };
  size_t robot = 0;  // The arm of the result in whose place the arm stands.
  ReachingArm arm;
  std::vector<Posture> postures;
  std::string reason;  // Why there is none.
};

// A pose to command so that the gripper of an arm with estimated errors truly reaches a target.
struct ReachCommand {
  std::string configuration;  // That of the arm; empty if it has no name.
  std::string reason;         // Why there is none; the fields below are then not set.
  Rigid3d base_from_gripper;
  Eigen::VectorXd joints;         // At which the controller reports the pose, rad or m.
  PositionCovariance covariance;  // CovarianceOfReachInCell.
  // Whether no capture is in this configuration, so that the arm's errors are extrapolated.
  bool is_extrapolated = false;
};
struct TargetReach {
  size_t robot = 0;                     // The arm, whose errors are estimated.
  std::string captured_configuration;   // RobotSummary::configuration.
  Rigid3d wanted;                       // The pose to reach, in the base of the arm.
  std::optional<ReachCommand> command;  // Nothing if the captures are in several configurations.
  std::vector<ReachCommand> in_each;    // In each configuration, if they were asked for.
  bool has_each = false;
  std::string reason;  // Why there are none in any configuration.
};

// One of the poses of a target that fit the images.
struct PossiblePose {
  LocatedTarget located;
  std::vector<ReachingPostures> postures;  // Each arm that was named has an entry.
};

// A pixel on a plane.
struct PixelPosition {
  CameraPixel pixel;
  LocatedPoint point;
  // With the flange pointing at the plane: its z axis opposes the normal.
  std::vector<ReachingPostures> postures;
};

// How far a rough pose is from each of the poses of a target that fit.
struct NearPoses {
  std::vector<double> angles_rad;
  std::vector<double> distances_m;
  double least_distance_m = 0;  // LeastDistanceM of the poses.
};

// The pose and the joints of an arm at which images were taken, as far as they are given.
struct GivenArmPose {
  std::optional<Rigid3d> base_from_gripper;
  std::optional<Eigen::VectorXd> joints;  // rad or m.
};
// The pose of an arm at which images were taken.
struct ArmPose {
  bool carries_camera = false;    // Whether it carries one of the cameras.
  StatedPose stated;              // With its errors, if they are estimated and known; the identity if it carries none.
  std::string why_not_corrected;  // If the errors of the arm are estimated, but not those of this pose.
};
// Returns the pose of each arm for images of these cameras. Throws InputError, which begins with `pose_name` or
// `joints_name`, if an arm that carries one of the cameras has no pose, if one that carries none of them has one, or if
// the joints are not those of the arm at its pose.
std::vector<ArmPose> PosesForCameras(const RunResult& result, const std::vector<size_t>& cameras,
                                     const std::vector<GivenArmPose>& given, const std::string& pose_name,
                                     const std::string& joints_name);

// The request for the images of one call.
struct LocationRequest {
  const RunResult* result = nullptr;  // The symmetries of its targets are set.
  std::vector<std::shared_ptr<const Target>> targets;
  std::vector<ArmPose> arms;                      // One per arm (PosesForCameras).
  std::vector<CameraPixel> pixels;                // Empty: the targets are located.
  std::optional<Plane> plane;                     // The plane of the pixels.
  std::vector<std::optional<Rigid3d>> near = {};  // A rough world_from_target of each target; an empty list: none.
  std::string near_form = {};  // How a user gives such a pose, for messages: "--near x,y,z,qx,qy,qz,qw".
  std::vector<std::optional<ReachingArm>> reaching = {};  // One per arm; an empty list: none.
  // The tool that is to come to the grasp; both are the identity if nothing was said.
  Rigid3d gripper_from_tool = {};
  Rigid3d target_from_grasp = {};
  bool has_grasp = false;  // Whether one of them was given.

  // Returns the gripper's pose in the target with the tool at the grasp.
  Rigid3d TargetFromGripper() const { return target_from_grasp * Inverse(gripper_from_tool); }
};

// Returns the covariance, along the axes of the world, of a point of a located target.
Eigen::Matrix3d CovarianceOfPoint(const LocatedTarget& located, const Eigen::Vector3d& point_in_target);

// The detection of one target in the image of one camera.
struct Sighting {
  size_t camera = 0;
  size_t target = 0;
  Detection detection;
};

struct TargetLocation {
  size_t target = 0;
  std::vector<size_t> cameras;         // The cameras that see enough points of it.
  size_t num_points = 0;               // The number of its points in their images.
  std::vector<PossiblePose> possible;  // Empty if it is not located, or if pixels are asked for.
  std::optional<size_t> chosen;        // The index of the pose that is meant; nothing if none is.
  std::optional<NearPoses> near;       // Of LocationRequest::near and the possible poses.
  std::vector<TargetReach> reaches;    // The reach of the chosen pose by each arm whose errors are estimated.
  std::optional<LocationContradiction> contradiction;
  Failure undetermined;  // Why the points do not determine a pose; empty otherwise.
};

// The images of one moment show targets or pixels.
struct ImageLocation {
  std::string image;  // The name of the image of a single camera; empty if there is none.
  std::vector<TargetLocation> targets;
  std::vector<PixelPosition> pixels;
  std::optional<LocatedPoint> point;  // The point that the pixels show together.
  Failure fault;                      // Why nothing is located; empty otherwise.

  bool IsLocated() const;
};

// Locates each target of which a camera sees at least four points; that of a single camera is stated in any case.
// Images that contradict each other locate nothing.
//
// Pixels are located on LocationRequest::plane if there is one, otherwise on the target of the only sighting, in which
// case the normal is on the side that the camera sees. Without both, they show one point together. A pixel that cannot
// be located is a fault of all.
ImageLocation LocateInImages(const LocationRequest& request, const std::string& image,
                             const std::vector<Sighting>& sightings);

// One sigma of a pose as a motion along and about the world's axes.
struct PoseSigmas {
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();
};
struct PoseSigmasBySource {
  PoseSigmas total;
  PoseSigmas by_calibration;
  PoseSigmas by_image;
  PoseSigmas by_robot;
};
// Returns the sigmas of a located target: those of its centre (LocatedTarget::covariance) and of its rotation.
PoseSigmasBySource SigmasOf(const Solution& solution, const LocatedTarget& located);

}  // namespace heba
