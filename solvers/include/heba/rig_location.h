// Locates a target, or a point, that several cameras of a rig see at once, in the world, with its covariance.
//
//   const heba::Outcome<heba::RigLocation> located =
//       heba::LocateInRig(result.rig, result.solution, {{left, seen_left}, {right, seen_right}}, base_from_gripper);
#pragma once

#include <optional>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/rig.h"
#include "heba/data/rig_solution.h"
#include "heba/data/stated_pose.h"

namespace heba {

// The points of one target that a camera sees.
struct CameraObservations {
  size_t camera = 0;
  Observations observations;
};

struct RigLocation {
  Rigid3d world_from_target;
  // Covariance of the pose as a motion along and about the axes of the target (m, then rad, in the target's frame), by
  // its sources: the calibration, with all its correlations; the images; the noise of the arms that carry cameras.
  Eigen::Matrix<double, 6, 6> by_calibration = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 6> by_image = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 6> by_robot = Eigen::Matrix<double, 6, 6>::Zero();
  double rms_px = 0;  // Over all points of all cameras.
  // The probability that the poses of the target in images of cameras that agree differ by as much as these, given the
  // uncertainties of the calibration, of the images and of the arms (Fisher's F); 1 for a single camera.
  double p_value = 1;

  Eigen::Matrix<double, 6, 6> Total() const { return by_calibration + by_image + by_robot; }
};

// Images with a smaller RigLocation::p_value contradict each other. It is this small so that errors of twice the stated
// size, which a real cell may have, are no contradiction between up to four cameras.
inline constexpr double kContradictionPValue = 1e-9;

// Locates a target, whose points are as manufactured, by least squares over the points of all cameras, whitened by the
// noise of each camera (RigSolution::pixel_sigmas_px and image_sigmas_px). The errors of the arms' poses are unknowns
// with the arms' noise as their prior, so that a camera on a noisy arm counts for less. `base_from_gripper` has the
// pose of each arm as it states it, which is corrected by the estimated errors of the arm (Correct); those of arms that
// carry none of these cameras are not used. Returns a Failure if no image determines a pose, or if the images
// contradict each other so much that a point has no image. Images that contradict each other less have a location with
// a small RigLocation::p_value.
Outcome<RigLocation> LocateInRig(const RigProblem& rig, const RigSolution& solution,
                                 const std::vector<CameraObservations>& seen,
                                 const std::vector<StatedPose>& base_from_gripper);

// Locates the target of the rig with the index `target`, with the shape that the solution has estimated. The points of
// `seen` are as designed, and each camera may have read them in any of the orders that the symmetries of the target
// allow (RigTarget::symmetries): those of the cameras are made to agree. Returns one pose for each symmetry, all of
// which fit the images equally well; the one whose x axis points most along that of the world comes first. Returns a
// Failure if one of the poses cannot be determined.
Outcome<std::vector<RigLocation>> LocateTargetInRig(const RigProblem& rig, const RigSolution& solution, size_t target,
                                                    const std::vector<CameraObservations>& seen,
                                                    const std::vector<StatedPose>& base_from_gripper);

// A contradiction between the images of several cameras.
struct RigContradiction {
  // The camera without which the others agree; nothing if that is true of none or of several of them.
  std::optional<size_t> camera;
  // The pose of the target by that camera alone, in the target as the others see it; if there are two cameras, the pose
  // by the second in the target as the first sees it. Of a target with symmetries, the smallest of these motions.
  // Nothing if it cannot be determined.
  std::optional<Rigid3d> difference;
};
// Returns the contradiction between these images of a target (LocateTargetInRig), or nothing if they agree, or if fewer
// than two cameras determine a pose by themselves.
std::optional<RigContradiction> FindContradiction(const RigProblem& rig, const RigSolution& solution, size_t target,
                                                  const std::vector<CameraObservations>& seen,
                                                  const std::vector<StatedPose>& base_from_gripper);

// A pixel of one camera.
struct CameraPixel {
  size_t camera = 0;
  Eigen::Vector2d pixel;
};

struct RigPoint {
  Eigen::Vector3d in_world = Eigen::Vector3d::Zero();  // m
  // Covariance along the axes of the world, m^2, by its sources.
  Eigen::Matrix3d by_calibration_m2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d by_image_m2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d by_robot_m2 = Eigen::Matrix3d::Zero();
  double rms_px = 0;  // Of the distances between the pixels and the projections of the point.

  Eigen::Matrix3d TotalM2() const { return by_calibration_m2 + by_image_m2 + by_robot_m2; }
};

// Triangulates a point from its pixels in at least two cameras, by least squares over the whitened distances. Returns a
// Failure if there are fewer than two pixels, or if the rays do not determine a point in front of the cameras.
Outcome<RigPoint> TriangulateInRig(const RigProblem& rig, const RigSolution& solution,
                                   const std::vector<CameraPixel>& pixels,
                                   const std::vector<StatedPose>& base_from_gripper);

}  // namespace heba
