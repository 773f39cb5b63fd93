// Locates a target that an image shows, or a pixel on a plane, in the robot's base.
//
//   const heba::RunResult result = heba::ReadResult("runs/cell/result.json");
//   const heba::Solution& solution = *heba::FindRefined(result)->solution;
//   const heba::Observations seen = heba::ObservationsOf(*target, target->Detect(grey));
//   const auto located = heba::LocateTarget(result.setup, solution, seen, base_from_gripper);
#pragma once

#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/data/setup.h"
#include "heba/data/solution.h"

namespace heba {

// Covariance of a position along the base's axes, m^2, by its sources: the calibration (hand-eye pose and intrinsics,
// with their correlations), the pixel noise of the image, and, if the robot carries the camera and its noise is known,
// the robot's pose.
struct PositionCovariance {
  Eigen::Matrix3d by_calibration_m2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d by_image_m2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d by_robot_m2 = Eigen::Matrix3d::Zero();

  Eigen::Matrix3d TotalM2() const { return by_calibration_m2 + by_image_m2 + by_robot_m2; }
};

struct LocatedTarget {
  Rigid3d base_from_target;
  double rms_px = 0;              // RMS of the target's points.
  PositionCovariance covariance;  // Covariance of the mean of the points that were seen.
};

// Locates a target. `base_from_camera_mount` is the gripper's pose for a camera that the robot carries, and the
// identity for a stationary camera. Returns a Failure if the points do not determine a pose
// (solvers/initial/target_pose.h).
Outcome<LocatedTarget> LocateTarget(Setup setup, const Solution& solution, const Observations& observations,
                                    const Rigid3d& base_from_camera_mount);

// Locates a target that looks the same after each of `symmetries` (target_from_target, Target::Symmetries()): returns
// one pose for each of them, all of which fit the same image. `observations` may have been read in any of these
// orders. The result does not depend on the order: the pose whose x axis points most along the base's x axis comes
// first. Returns a Failure if one of the poses cannot be determined.
Outcome<std::vector<LocatedTarget>> LocateSymmetricTarget(Setup setup, const Solution& solution,
                                                          const Observations& observations,
                                                          const std::vector<Rigid3d>& symmetries,
                                                          const Rigid3d& base_from_camera_mount);

// A rough rotation decides between two rotations if it is nearer to one of them by at least this much.
inline constexpr double kMinRotationGapRad = DegToRad(30);

// Returns the index in `possible` of the pose whose rotation is nearest to that of `rough`, or nothing if another one
// is less than kMinRotationGapRad farther away. The translations are not compared, because the symmetries of a target
// are rotations that differ by 90 deg or more.
std::optional<size_t> FindMeantPose(const std::vector<LocatedTarget>& possible, const Rigid3d& rough);

// The plane n . p = distance, for points p in the base.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // Unit vector.
  double distance_m = 0;
};

// The position of a pixel on a plane.
struct LocatedPoint {
  Eigen::Vector3d in_base = Eigen::Vector3d::Zero();
  // A given plane counts as exact; the plane of a target has the uncertainty of the pose that its image shows.
  PositionCovariance covariance;
};

// Intersects the ray of `pixel` with `plane`. Returns a Failure if they do not meet in front of the camera.
Outcome<LocatedPoint> LocatePixel(Setup setup, const Solution& solution, const Eigen::Vector2d& pixel,
                                  const Plane& plane, const Rigid3d& base_from_camera_mount);
// Intersects the ray of `pixel` with the plane z = 0 of a target that the same image shows.
Outcome<LocatedPoint> LocatePixelOnTarget(Setup setup, const Solution& solution, const Eigen::Vector2d& pixel,
                                          const Observations& observations, const Rigid3d& base_from_camera_mount);

}  // namespace heba
