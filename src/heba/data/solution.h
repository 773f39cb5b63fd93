// What a refinement found, and how well it is known.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/data/problem.h"

namespace heba {

// One-sigma covariance of the free parameters, in the order of `names`: "hand_eye.tx_m" ... "hand_eye.rz_rad",
// "board.tx_m" ... "board.rz_rad", then "camera.fx" ... The tangents are those of camera_mount_from_camera and of
// target_mount_from_target, translation before rotation, in the child frame: T * exp(xi). Last, where the target's
// shape was free: "target.scale_x", "target.scale_y", "target.bend_x_m", "target.bend_y_m".
struct Covariance {
  std::vector<std::string> names;
  Eigen::MatrixXd matrix;
};

// One sigma of a parameter; nothing if it was held.
inline std::optional<double> SigmaOf(const Covariance& covariance, const std::string& name) {
  const auto found = std::find(covariance.names.begin(), covariance.names.end(), name);
  if (found == covariance.names.end()) return std::nullopt;
  const Eigen::Index i = found - covariance.names.begin();
  return std::sqrt(covariance.matrix(i, i));
}

// One sigma along and about each axis of the gripper's frame.
struct RobotNoise {
  double translation_m = 0;
  double rotation_rad = 0;
};

// What a result would move by without one of its captures.
struct CaptureMove {
  Tangent6 tangent = Tangent6::Zero();  // Of camera_mount_from_camera: m and rad, in the camera's frame.
  double chance = 1;                    // Of such a move or a larger one, if the capture is as the others.
};

struct Convergence {
  bool converged = false;
  int iterations = 0;
  // Half the sum of rho(squared whitened residuals), as Ceres counts.
  double initial_cost = 0;
  double final_cost = 0;
  double seconds = 0;
  std::string message;
};

struct Solution {
  HandEye hand_eye;
  Camera camera;
  // As designed, if no part of it was free. The points of the problem's views are as designed in either case.
  TargetShape shape;
  // Per coordinate; estimated from the residuals or as given.
  double pixel_sigma_px = 0;
  // Of that, what the detectors do not know of by themselves (solvers/residuals/noise_scale.h); nothing if they say
  // nothing.
  std::optional<double> unmodelled_sigma_px;
  // If the robot's poses were observations: their noise, estimated or as given, and, if it was estimated, how well it
  // is known (one sigma of each sigma).
  std::optional<RobotNoise> robot_noise;
  std::optional<RobotNoise> robot_noise_stddev;
  // Then also, for each view, the pose of the gripper as the pictures have it, in the gripper's frame as the robot had
  // it.
  std::vector<Rigid3d> corrections;
  // For each view, the ids of the points that were left out because they are not where the others say.
  std::vector<std::vector<int>> rejected_ids;
  Covariance covariance;
  // How many degrees of freedom the estimate of the noise leaves it: a region of confidence is one of Fisher's F with
  // so many in the denominator. Infinite if the noise was given.
  double covariance_dof = std::numeric_limits<double>::infinity();
  Convergence convergence;
};

}  // namespace heba
