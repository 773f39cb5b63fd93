// The result of the refinement of one camera, one target and one arm, and its uncertainty.
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "heba/data/pair_problem.h"
#include "heba/data/unknowns.h"

namespace heba {

// Covariance of the free unknowns (one sigma). The tangents of the poses are those of camera_mount_from_camera and of
// target_mount_from_target, translation before rotation, in the child frame: T * exp(xi).
struct Covariance {
  UnknownLayout layout;
  Eigen::MatrixXd matrix;
};

// Returns one sigma of a parameter; nothing if the parameter was held.
inline std::optional<double> SigmaOf(const Covariance& covariance, std::string_view name) {
  const std::optional<Eigen::Index> place = covariance.layout.Place(name);
  if (!place) return std::nullopt;
  return std::sqrt(covariance.matrix(*place, *place));
}

// Returns the covariance of a pose's tangent (m, rad), for example of `hand_eye` or `board`; nothing if the pose was
// held.
inline std::optional<Eigen::Matrix<double, 6, 6>> PoseCovarianceOf(const Covariance& covariance,
                                                                   std::string_view pose) {
  const UnknownBlock block = covariance.layout.Block(pose);
  if (block.size != 6) return std::nullopt;
  return covariance.matrix.block<6, 6>(block.first, block.first);
}

// Robot noise: one sigma along and about each axis of the gripper's frame, and one sigma of the position of each joint
// (rad; m if it slides), which is zero unless the noise of the joints is modelled (View::gripper_by_joints).
struct RobotNoise {
  double translation_m = 0;
  double rotation_rad = 0;
  double joint_rad = 0;
};

// Prior knowledge of a robot's noise: log-normal densities of its two sigmas.
struct RobotNoisePrior {
  RobotNoise median;
  double log_sigma = 1;  // Standard deviation of the logarithm of either sigma.
};

// The change of a result if one of its captures is left out.
struct CaptureMove {
  Tangent6 tangent = Tangent6::Zero();  // Change of the camera's pose in its mount: m and rad, in the camera's frame.
  double p_value = 1;  // Probability of a change at least this large if the capture is consistent with the others.
};

// The outcome of a solution for one view.
struct ViewOutcome {
  // Set if the robot's poses were observations: the pose of the gripper according to the image, in the gripper's frame
  // according to the robot.
  std::optional<Rigid3d> correction;
  // The ids of the points that were rejected because they contradict the others.
  std::vector<int> rejected_ids;
};

struct Convergence {
  bool converged = false;
  int iterations = 0;
  // Half the sum of rho(squared whitened residuals), as Ceres defines the cost.
  double initial_cost = 0;
  double final_cost = 0;
  double seconds = 0;
  std::string message;
};

struct PairSolution {
  HandEye hand_eye;
  Camera camera;
  // The designed shape if no part of it was free. The points of the problem's views are the designed ones in either
  // case.
  TargetShape shape;
  // The effects that were estimated, their values, and the standard deviation of each of their groups; null and empty
  // if the robot's errors were not modelled.
  std::shared_ptr<const SharedEffects> shared_effects;
  Eigen::VectorXd effects;
  std::vector<double> effect_sigmas;
  // If errors that vary smoothly with the pose were estimated (heba/data/smooth_errors.h): their standard deviations at
  // any pose. They are not part of robot_noise.
  std::optional<RobotNoise> smooth_noise;
  // One sigma of each pixel coordinate, estimated from the residuals or given.
  double pixel_sigma_px = 0;
  // The part of pixel_sigma_px that is not explained by the detector's own covariances
  // (solvers/residuals/noise_scale.h); nothing if the detector provides none.
  std::optional<double> unmodelled_sigma_px;
  // If the robot's poses were observations: their noise, estimated or given, and, if it was estimated, one sigma of
  // each of its sigmas.
  std::optional<RobotNoise> robot_noise;
  std::optional<RobotNoise> robot_noise_stddev;
  std::vector<ViewOutcome> views;  // One per view of the problem.
  Covariance covariance;
  // The covariance without what all sessions of a cell have in common: the scales of its targets and robots. Empty if
  // it is not known.
  Covariance covariance_repeatable;
  // Degrees of freedom of the noise estimate on which the covariance is based. A confidence region is a region of
  // Fisher's F with this number of degrees of freedom in the denominator. Infinite if the noise was given.
  double covariance_dof = std::numeric_limits<double>::infinity();
  Convergence convergence;
};

// Returns camera_mount_from_target_mount with the errors of the robot that the solution has found. `effect` is
// View::effect.
Rigid3d CorrectedMount(Setup setup, const Rigid3d& camera_mount_from_target_mount, const PoseEffect* effect,
                       const PairSolution& solution);
Rigid3d CorrectedMount(Setup setup, const View& view, const PairSolution& solution);
// Returns the views with these mounts and without effects, as if the robot had reported the corrected poses.
std::vector<View> CorrectedViews(Setup setup, const std::vector<View>& views, const PairSolution& solution);

// Returns the corrections of all views; an empty list if the robot was exact.
inline std::vector<Rigid3d> CorrectionsOf(const PairSolution& solution) {
  std::vector<Rigid3d> corrections;
  for (const ViewOutcome& view : solution.views) {
    if (view.correction) corrections.push_back(*view.correction);
  }
  return corrections;
}

}  // namespace heba
