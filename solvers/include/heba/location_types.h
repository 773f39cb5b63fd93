// These types state where a target, or a pixel, is in the world, with the uncertainty by its sources. The world is the
// base of the first arm, and that of the only arm of a hand-eye calibration.
#pragma once

#include <Eigen/Core>

#include "heba/data/pair_solution.h"
#include "heba/data/unknowns.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// Covariance of a position along the world's axes, m^2, by its sources: the calibration (poses, intrinsics and the
// errors of arms that captures share, with all their correlations), the pixel noise of the images, and, if the position
// depends on poses of arms whose noise is known, this noise.
struct PositionCovariance {
  Eigen::Matrix3d by_calibration_m2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d by_image_m2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d by_robot_m2 = Eigen::Matrix3d::Zero();

  Eigen::Matrix3d TotalM2() const { return by_calibration_m2 + by_image_m2 + by_robot_m2; }
};

// Covariance of a pose by the same sources, as a motion along and about the axes of its own frame (m, then rad).
struct PoseCovariance {
  Eigen::Matrix<double, 6, 6> by_calibration = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 6> by_image = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 6> by_robot = Eigen::Matrix<double, 6, 6>::Zero();

  Eigen::Matrix<double, 6, 6> Total() const { return by_calibration + by_image + by_robot; }
};

// Uncertainty of a pose in the world as a motion of its frame along and about the world's axes (p' = p + v + w x p: v
// in m, then w in rad), by its sources.
struct PoseUncertainty {
  Matrix6X by_unknowns;  // Derivative by the unknowns of the solution's covariance.
  Eigen::Matrix<double, 6, 6> by_image = Eigen::Matrix<double, 6, 6>::Zero();  // Covariance.
  Matrix6X by_corrections = Matrix6X(6, 0);  // Derivative by the errors of the arms' poses, in units of their sigmas.

  Eigen::Matrix<double, 6, 6> ByRobot() const { return by_corrections * by_corrections.transpose(); }
};

// Returns the covariance of a point that moves with a frame. `covariance`: that of the solution.
PositionCovariance CovarianceOfPoint(const Covariance& covariance, const PoseUncertainty& frame,
                                     const Eigen::Vector3d& in_world);

struct LocatedTarget {
  Rigid3d world_from_target;
  double rms_px = 0;  // Over all points of all cameras.
  // The probability that the poses of the target in images of cameras that agree differ by as much as these, given the
  // uncertainties of the calibration, of the images and of the arms (Fisher's F); 1 for a single camera.
  double p_value = 1;
  PoseUncertainty uncertainty;
  PoseCovariance pose_covariance;
  PositionCovariance covariance;  // The covariance of the mean of the points that were seen.
};

// The plane n . p = distance, for points p in the world.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // Unit vector.
  double distance_m = 0;
};

struct LocatedPoint {
  Eigen::Vector3d in_world = Eigen::Vector3d::Zero();  // m
  PositionCovariance covariance;
  double rms_px = 0;  // The RMS distance between the pixels and the projections of the point; 0 for one pixel.
};

}  // namespace heba
