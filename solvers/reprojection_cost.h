// The Ceres cost of one view: one small residual block however many points it has (solvers/view_reduction.h).
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <ceres/cost_function.h>

#include "heba/camera/camera_model.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "solvers/loss.h"

namespace heba {

// How camera_from_target follows from the pose blocks (heba/geometry/pose_block.h) of a cost.
struct PoseChain {
  // Computes camera_from_target and, for each block, the 6 x 6 derivative of its left perturbation by the block's
  // tangent.
  virtual ~PoseChain() = default;
  virtual int num_blocks() const = 0;
  virtual Rigid3d Evaluate(const double* const* pose_blocks,
                           std::vector<Eigen::Matrix<double, 6, 6>>* left_from_tangent) const = 0;
};

// Blocks: camera_mount_from_camera, target_mount_from_target.
std::unique_ptr<PoseChain> MakeHandEyeChain(const Rigid3d& camera_mount_from_target_mount);
// Blocks: camera_mount_from_camera, target_mount_from_target, the capture's correction (solvers/robot_noise.h).
std::unique_ptr<PoseChain> MakeCorrectedChain(Setup setup, const Rigid3d& camera_mount_from_target_mount);
// Block: camera_from_target.
std::unique_ptr<PoseChain> MakeFreePoseChain();

// Parameter blocks: the chain's poses, then the camera's parameters, which those of the target's shape follow if there
// is a `shape` (its own are not used). Evaluation fails, and Ceres rejects the step, if a point has no image. `model`,
// `observations` and `loss` must outlive the cost.
std::unique_ptr<ceres::CostFunction> MakeReprojectionCost(const CameraModel& model, const Observations& observations,
                                                          double pixel_sigma_px, const Loss& loss,
                                                          std::unique_ptr<PoseChain> chain,
                                                          const std::optional<TargetShape>& shape = std::nullopt);

// What the robot says of a capture's correction: that it is zero, give or take `noise`. Parameter block: the
// correction.
std::unique_ptr<ceres::CostFunction> MakeCorrectionPrior(const RobotNoise& noise);

}  // namespace heba
