// Locates a target, or a point, that one or several cameras of a rig see at once, in the world, with its covariance,
// and states how closely a gripper reaches it. A hand-eye calibration is a rig with one camera
// (heba/target_location.h).
//
//   const heba::Outcome<heba::LocatedTarget> located =
//       heba::LocateInCell(result.rig, result.solution, {{left, seen_left}, {right, seen_right}}, base_from_gripper);
#pragma once

#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/data/stated_pose.h"
#include "heba/location_types.h"

namespace heba {

// The points of one target that a camera sees.
struct CameraObservations {
  size_t camera = 0;
  Observations observations;
};

// Images with a smaller LocatedTarget::p_value contradict each other. It is this small so that errors of twice the
// stated size, which a real cell may have, are no contradiction between up to four cameras.
inline constexpr double kContradictionPValue = 1e-9;

// Locates a target, whose points are as manufactured, by least squares over the points of all cameras, whitened by the
// noise of each camera (Solution::pixel_sigmas_px and image_sigmas_px). The errors of the arms' poses are unknowns
// with the arms' noise as their prior, so that a camera on a noisy arm counts for less. `base_from_gripper` has the
// pose of each arm as it states it, which is corrected by the estimated errors of the arm (Correct); those of arms that
// carry none of these cameras are not used. Returns a Failure if no image determines a pose, or if the images
// contradict each other so much that a point has no image. Images that contradict each other less have a location with
// a small LocatedTarget::p_value.
Outcome<LocatedTarget> LocateInCell(const Problem& rig, const Solution& solution,
                                    const std::vector<CameraObservations>& seen,
                                    const std::vector<StatedPose>& base_from_gripper);

// Locates the target of the rig with the index `target`, with the shape that the solution has estimated. The points of
// `seen` are as designed, and each camera may have read them in any of the orders that the symmetries of the target
// allow (ProblemTarget::symmetries): those of the cameras are made to agree. Returns one pose for each symmetry, all of
// which fit the images equally well; the one whose x axis points most along that of the world comes first. Returns a
// Failure if one of the poses cannot be determined.
Outcome<std::vector<LocatedTarget>> LocateTargetInCell(const Problem& rig, const Solution& solution, size_t target,
                                                       const std::vector<CameraObservations>& seen,
                                                       const std::vector<StatedPose>& base_from_gripper);

// A contradiction between the images of several cameras.
struct LocationContradiction {
  // The camera without which the others agree; nothing if that is true of none or of several of them.
  std::optional<size_t> camera;
  // The pose of the target by that camera alone, in the target as the others see it; if there are two cameras, the pose
  // by the second in the target as the first sees it. Of a target with symmetries, the smallest of these motions.
  // Nothing if it cannot be determined.
  std::optional<Rigid3d> difference;
};
// Returns the contradiction between these images of a target (LocateTargetInCell), or nothing if they agree, or if
// fewer than two cameras determine a pose by themselves.
std::optional<LocationContradiction> FindContradiction(const Problem& rig, const Solution& solution, size_t target,
                                                       const std::vector<CameraObservations>& seen,
                                                       const std::vector<StatedPose>& base_from_gripper);

// A pixel of one camera.
struct CameraPixel {
  size_t camera = 0;
  Eigen::Vector2d pixel;
};

// Triangulates a point from its pixels in at least two cameras, by least squares over the whitened distances. Returns a
// Failure if there are fewer than two pixels, or if the rays do not determine a point in front of the cameras.
Outcome<LocatedPoint> TriangulateInCell(const Problem& rig, const Solution& solution,
                                        const std::vector<CameraPixel>& pixels,
                                        const std::vector<StatedPose>& base_from_gripper);

// Intersects the ray of a pixel with `plane`, which counts as exact. Returns a Failure if they do not meet in front of
// the camera.
Outcome<LocatedPoint> LocatePixelInCell(const Problem& rig, const Solution& solution, const CameraPixel& pixel,
                                        const Plane& plane, const std::vector<StatedPose>& base_from_gripper);
// Intersects the ray of a pixel with the plane z = 0 of a located target. The poses of the arms are those with which it
// was located, and the noise of the pixel is independent of that of the target's points. Returns a Failure if they do
// not meet in front of the camera.
Outcome<LocatedPoint> LocatePixelOnTargetInCell(const Problem& rig, const Solution& solution, const CameraPixel& pixel,
                                                const LocatedTarget& target,
                                                const std::vector<StatedPose>& base_from_gripper);

// Returns the covariance of the vector from a point of a located target to a point of the gripper of arm `robot`, which
// is sent to `command` after the images were taken. The errors of the calibration partly cancel: those of its poses and
// of the arms' errors are correlated, and the farther the command's posture is from those of the captures, the less
// they do. `command` has the effect of the arm's errors if the solution has estimated them; the noise of the arm's pose
// counts for the command, too. The frame of the gripper is that of the calibration: it includes what no captures
// determine, such as an offset of the arm's last joint.
PositionCovariance CovarianceOfReachInCell(const Problem& rig, const Solution& solution, size_t robot,
                                           const LocatedTarget& located, const StatedPose& command,
                                           const Eigen::Vector3d& point_in_gripper = Eigen::Vector3d::Zero(),
                                           const Eigen::Vector3d& point_in_target = Eigen::Vector3d::Zero());

}  // namespace heba
