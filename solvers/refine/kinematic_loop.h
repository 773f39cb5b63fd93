// Kinematic loops compute the pose of the target in a capture's camera from the unknown poses of a refinement:
// equations (1) and (2) of docs/estimation.md.
#pragma once

#include <memory>
#include <vector>

#include "heba/data/problem.h"
#include "solvers/uncertainty/robot_noise.h"

namespace heba {

// Computes camera_from_target from the pose blocks (heba/geometry/pose_block.h) of a cost.
struct KinematicLoop {
  // Returns camera_from_target and, for each block, the 6 x 6 derivative of its left perturbation with respect to the
  // tangent of the block. `left_from_tangent` may be null.
  virtual ~KinematicLoop() = default;
  virtual int num_blocks() const = 0;
  virtual Rigid3d Evaluate(const double* const* pose_blocks, std::vector<Matrix6>* left_from_tangent) const = 0;
};

// Blocks: camera_mount_from_camera, target_mount_from_target.
std::unique_ptr<KinematicLoop> MakeHandEyeLoop(const Rigid3d& camera_mount_from_target_mount);
// Blocks: camera_mount_from_camera, target_mount_from_target, the capture's correction
// (solvers/uncertainty/robot_noise.h).
std::unique_ptr<KinematicLoop> MakeCorrectedLoop(Setup setup, const Rigid3d& camera_mount_from_target_mount);
// Block: camera_from_target.
std::unique_ptr<KinematicLoop> MakeFreePoseLoop();

}  // namespace heba
