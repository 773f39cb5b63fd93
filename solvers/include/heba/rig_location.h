// Locates a target, or a point, that several cameras of a rig see at once, in the world, with its covariance.
//
//   const heba::Outcome<heba::RigLocation> located =
//       heba::LocateInRig(result.rig, result.solution, {{left, seen_left}, {right, seen_right}}, base_from_gripper);
#pragma once

#include <vector>

#include "heba/base/error.h"
#include "heba/data/rig.h"
#include "heba/data/rig_solution.h"

namespace heba {

// The points of one target that a camera sees, with the target's points as designed or, if its shape was estimated, as
// they are.
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

  Eigen::Matrix<double, 6, 6> Total() const { return by_calibration + by_image + by_robot; }
};

// Locates a target by least squares over the points of all cameras, whitened by the noise of each camera
// (RigSolution::pixel_sigmas_px and image_sigmas_px). The errors of the arms' poses are unknowns with the arms' noise
// as their prior, so that a camera on a noisy arm counts for less. `base_from_gripper` has the pose of each arm; those
// of arms that carry none of these cameras are not used. Returns a Failure if no image determines a pose, or if the
// images contradict each other so much that a point has no image.
Outcome<RigLocation> LocateInRig(const RigProblem& rig, const RigSolution& solution,
                                 const std::vector<CameraObservations>& seen,
                                 const std::vector<Rigid3d>& base_from_gripper);

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
                                   const std::vector<Rigid3d>& base_from_gripper);

}  // namespace heba
