// Locates the target, or pixels, of an image in the robot's base, with the sigmas and with the joints of an arm that
// reaches it: all values that `heba locate` states.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "heba/base/error.h"
#include "heba/detection.h"
#include "heba/evaluation/evaluation.h"
#include "heba/robot/ur_kinematics.h"
#include "heba/robot/urdf_arm.h"
#include "heba/target.h"
#include "heba/target_location.h"

namespace heba {

// An arm whose joints are to be found: one of the built-in table, or a URDF's from its root to its only tip.
struct ReachingArm {
  std::string name;  // The name in the table, or the path of the URDF.
  const UrRobot* ur = nullptr;
  std::shared_ptr<const UrdfArm> urdf = nullptr;
};

// The joints with which an arm brings its flange (its tip for a URDF) to a pose in the base.
struct ReachingPostures {
  struct Posture {
    std::vector<double> joints;  // rad or m.
    std::string singularity;     // UrPosture::singularity.
  };
  std::string arm;
  bool is_urdf = false;
  std::vector<std::string> joint_names;
  std::vector<bool> are_turning;
  std::vector<Posture> postures;
  std::string reason;  // Why there is none.
};
ReachingPostures FindPostures(const ReachingArm& arm, const Rigid3d& base_from_tip);

// A pose to command so that the gripper of an arm with estimated errors truly reaches a target.
struct ReachCommand {
  std::string configuration;  // That of the arm; empty if it has no name.
  std::string reason;         // Why there is none; the fields below are then not set.
  Rigid3d base_from_gripper;
  Eigen::VectorXd joints;         // At which the controller reports the pose, rad or m.
  PositionCovariance covariance;  // CovarianceOfReach.
  // Whether no capture is in this configuration, so that the arm's errors are extrapolated.
  bool is_extrapolated = false;
};
struct Reach {
  std::string captured_configuration;   // RobotSummary::configuration.
  Rigid3d wanted;                       // The pose to reach.
  std::optional<ReachCommand> command;  // Nothing if the captures are in several configurations.
  std::vector<ReachCommand> in_each;    // In each configuration, if they were asked for.
  bool has_each = false;
  std::string reason_of_each;  // Why there are none in any configuration.
};
// Finds the pose to command in the configuration of the captures. `in_each`: also in all configurations; they are found
// in any case if those of the captures are several.
Reach FindReach(Setup setup, const RobotSummary& robot, const Solution& solution, const LocatedTarget& located,
                bool in_each);

// One of the poses of the target that fit an image.
struct PossiblePose {
  LocatedTarget located;
  std::optional<ReachingPostures> postures;  // Nothing if no arm was named.
};

// A pixel on a plane.
struct PixelPosition {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  LocatedPoint point;
  // With the flange pointing at the plane: its z axis opposes the normal. Nothing if no arm was named.
  std::optional<ReachingPostures> postures;
};

// How far a rough pose is from each of the poses of a target that fit.
struct NearPoses {
  std::vector<double> angles_rad;
  std::vector<double> distances_m;
  double least_distance_m = 0;  // LeastDistanceM of the poses.
};
NearPoses CompareToRough(const std::vector<Rigid3d>& possible, const Rigid3d& rough);
// Returns the index of the pose that is meant: the only one, or the one that `rough` is near to (FindMeantPose).
// Returns nothing if that does not decide.
std::optional<size_t> ChoosePose(const std::vector<Rigid3d>& possible, const std::optional<Rigid3d>& rough);

// The request for the images of one call.
struct LocationRequest {
  const RunResult* result = nullptr;
  const Target* target = nullptr;
  const RobotSummary* robot = nullptr;  // The arm whose errors are estimated, or null.
  StatedPose camera_mount;
  std::string why_not_corrected;        // If the errors of the arm are estimated, but not those of this pose.
  std::vector<Eigen::Vector2d> pixels;  // Empty: the target is located.
  std::optional<Plane> plane;           // The plane of the pixels; that of the target by default.
  std::optional<Rigid3d> near;          // A rough base_from_target.
  std::optional<ReachingArm> arm;
};

struct ImageLocation {
  std::string image;
  size_t num_points = 0;  // The number of the target's points in the image.
  size_t num_target_points = 0;
  std::vector<PossiblePose> possible;  // Empty if the target cannot be located, or if pixels are asked for.
  std::optional<size_t> chosen;        // The index of the pose that is meant; nothing if none is.
  std::optional<NearPoses> near;       // Of LocationRequest::near and the possible poses.
  std::optional<Reach> reach;          // The reach of the chosen pose, if the run has estimated the errors of an arm.
  std::vector<PixelPosition> pixels;
  std::string fault;  // Why nothing is located; empty otherwise.

  bool IsLocated() const { return chosen || !pixels.empty(); }
};

// Locates the target, or pixels, in one image with the refined estimate of a run.
ImageLocation LocateInImage(const LocationRequest& request, const std::string& image, const Detection& detection);

// One sigma of a pose as a motion along and about the base's axes.
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
