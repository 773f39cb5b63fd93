// Locates a target that an image shows, or a pixel on a plane, in the robot's base, and states how closely the gripper
// reaches it. The world of the types is that base.
//
//   const heba::RunResult result = heba::ReadWholeResult("runs/cell/result.json");
//   const heba::PairSolution& solution = *heba::FindRefined(result)->solution;
//   const heba::Observations seen = heba::ObservationsOf(*target, target->Detect(grey));
//   const auto located =
//       heba::LocateTarget(heba::SetupOf(result.rig.cameras[0].mount), solution, seen, base_from_gripper);
//
// If the run has estimated the errors of an arm that carries the camera, the pose comes with them, and with the effect
// of the noise of its joints:
//   {base_from_gripper, heba::MakeArmEffect(arm.nominal, joints, arm.tip_from_gripper),
//    heba::GripperByJoints(arm.nominal, joints, arm.tip_from_gripper)}
// where `arm` is *result.arms[0].
#pragma once

#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "heba/base/units.h"
#include "heba/data/pair_solution.h"
#include "heba/data/setup.h"
#include "heba/data/stated_pose.h"
#include "heba/location_types.h"

namespace heba {

// Locates a target. `camera_mount` is the gripper's pose for a camera that the robot carries, as the robot states it
// and with the effect of the robot's errors and the noise of its joints if the solution has estimated them, and the
// identity for a stationary camera. Returns a Failure if the points do not determine a pose
// (solvers/initial/target_pose.h).
Outcome<LocatedTarget> LocateTarget(Setup setup, const PairSolution& solution, const Observations& observations,
                                    const StatedPose& camera_mount);

// Locates a target that looks the same after each of `symmetries` (target_from_target, Target::Symmetries()): returns
// one pose for each of them, all of which fit the same image. `observations` may have been read in any of these
// orders. The result does not depend on the order: the pose whose x axis points most along the base's x axis comes
// first. Returns a Failure if one of the poses cannot be determined.
Outcome<std::vector<LocatedTarget>> LocateSymmetricTarget(Setup setup, const PairSolution& solution,
                                                          const Observations& observations,
                                                          const std::vector<Rigid3d>& symmetries,
                                                          const StatedPose& camera_mount);

// Returns the covariance of the vector from a point of a located target to a point of the gripper, which is sent to
// `command` after the image was taken. The errors of the calibration partly cancel: those of the hand-eye pose and of
// the robot's poses are correlated, and the farther the command's posture is from those of the captures, the less they
// do. `command` has the effect of the robot's errors if the solution has estimated them; the noise of the robot's pose
// counts for the command, too. The frame of the gripper is that of the calibration: it includes what no captures
// determine, such as an offset of the arm's last joint.
PositionCovariance CovarianceOfReach(Setup setup, const PairSolution& solution, const LocatedTarget& located,
                                     const StatedPose& command,
                                     const Eigen::Vector3d& point_in_gripper = Eigen::Vector3d::Zero(),
                                     const Eigen::Vector3d& point_in_target = Eigen::Vector3d::Zero());

// A rough rotation decides between two rotations if it is nearer to one of them by at least this much, and not farther
// from it than kMaxRoughRotationRad.
inline constexpr double kMinRotationGapRad = DegToRad(30);
inline constexpr double kMaxRoughRotationRad = DegToRad(75);
// A rough position decides if it is within this share of the distance between one pose and its nearest neighbour.
inline constexpr double kRoughPositionShare = 0.25;
// A position that decides for another pose than the rotation prevails if the rotation is farther off than this.
inline constexpr double kCloseRotationRad = DegToRad(30);

// Returns the least distance between the origins of two poses; 0 for fewer than two.
double LeastDistanceM(const std::vector<Rigid3d>& possible);

// Returns the index in `possible` of the pose that `rough` is near to: the one whose origin it is close to
// (kRoughPositionShare), or else the one whose rotation it is close to (kMinRotationGapRad, kMaxRoughRotationRad). One
// of the two may thus be unknown. Returns nothing if neither decides, or if they decide for different poses and the
// rotation is close (kCloseRotationRad). A single pose is returned whatever `rough` is.
std::optional<size_t> FindMeantPose(const std::vector<Rigid3d>& possible, const Rigid3d& rough);

// Intersects the ray of `pixel` with `plane`, which counts as exact. Returns a Failure if they do not meet in front of
// the camera.
Outcome<LocatedPoint> LocatePixel(Setup setup, const PairSolution& solution, const Eigen::Vector2d& pixel,
                                  const Plane& plane, const StatedPose& camera_mount);
// Intersects the ray of `pixel` with the plane z = 0 of a target that the same image shows; the plane has the
// uncertainty of the pose that the image shows.
Outcome<LocatedPoint> LocatePixelOnTarget(Setup setup, const PairSolution& solution, const Eigen::Vector2d& pixel,
                                          const Observations& observations, const StatedPose& camera_mount);

}  // namespace heba
