// What a calibration is for: where a target that a picture shows is, in the robot's base.
#pragma once

#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/data/setup.h"
#include "heba/data/solution.h"

namespace heba {

// How well a place is known, along the base's axes, m^2: by the calibration (hand-eye pose and intrinsics together, as
// they vary together), by the picture's pixel noise, and, where the robot carries the camera and its noise is known, by
// the robot's pose.
struct PositionCovariance {
  Eigen::Matrix3d by_calibration_m2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d by_image_m2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d by_robot_m2 = Eigen::Matrix3d::Zero();

  Eigen::Matrix3d TotalM2() const { return by_calibration_m2 + by_image_m2 + by_robot_m2; }
};

struct LocatedTarget {
  Rigid3d base_from_target;
  double rms_px = 0;              // Of the target's points.
  PositionCovariance covariance;  // Of the target's middle, the mean of the points that were seen.
};

// `base_from_camera_mount` is the gripper's pose for a camera that the robot carries, the identity for one that stands
// still. A Failure if the points do not tell a pose (solvers/initial/target_pose.h).
Outcome<LocatedTarget> LocateTarget(Setup setup, const Solution& solution, const Observations& observations,
                                    const Rigid3d& base_from_camera_mount);

// Locates a target that looks the same after each of `symmetries` (target_from_target, Target::Symmetries()): one pose
// for each of them, all of which fit the same image. `observations` may have been read in any of these orders. The
// result does not depend on which: the pose whose x axis points most along the base's x axis comes first. A Failure if
// one of the poses cannot be determined.
Outcome<std::vector<LocatedTarget>> LocateSymmetricTarget(Setup setup, const Solution& solution,
                                                          const Observations& observations,
                                                          const std::vector<Rigid3d>& symmetries,
                                                          const Rigid3d& base_from_camera_mount);

// Two rotations are told apart by a rough one if it is nearer to one of them by at least this much.
inline constexpr double kMinRotationGapRad = DegToRad(30);

// The pose that `rough` means: the index in `possible` of the pose whose rotation is nearest to that of `rough`.
// Nothing if another one is less than kMinRotationGapRad farther away. The translations are not compared, because the
// symmetries of a target are rotations that differ by 90 deg or more.
std::optional<size_t> FindMeantPose(const std::vector<LocatedTarget>& possible, const Rigid3d& rough);

// n . p = distance, for points p in the base.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // Of unit length.
  double distance_m = 0;
};

// A pixel's place on a plane.
struct LocatedPoint {
  Eigen::Vector3d in_base = Eigen::Vector3d::Zero();
  // The plane is taken as exact where it is given, and as the target's picture shows it otherwise.
  PositionCovariance covariance;
};

// Where the ray of `pixel` meets `plane`. A Failure if it does not, in front of the camera.
Outcome<LocatedPoint> LocatePixel(Setup setup, const Solution& solution, const Eigen::Vector2d& pixel,
                                  const Plane& plane, const Rigid3d& base_from_camera_mount);
// The same for the plane z = 0 of a target that the same picture shows.
Outcome<LocatedPoint> LocatePixelOnTarget(Setup setup, const Solution& solution, const Eigen::Vector2d& pixel,
                                          const Observations& observations, const Rigid3d& base_from_camera_mount);

}  // namespace heba
