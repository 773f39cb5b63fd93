// What a refinement found, and how well it is known.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/data/problem.h"

namespace heba {

// One-sigma covariance of the free parameters, in the order of `names`: "hand_eye.tx_m" ... "hand_eye.rz_rad",
// "board.tx_m" ... "board.rz_rad", then "camera.fx" ... The tangents are those of camera_mount_from_camera and of
// target_mount_from_target, translation before rotation, in the child frame: T * exp(xi).
struct Covariance {
  std::vector<std::string> names;
  Eigen::MatrixXd matrix;
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
  // Per coordinate; estimated from the residuals or as given.
  double pixel_sigma_px = 0;
  Covariance covariance;
  Convergence convergence;
  // What a person should know of it though it is usable: one sentence each.
  std::vector<std::string> remarks;
};

}  // namespace heba
