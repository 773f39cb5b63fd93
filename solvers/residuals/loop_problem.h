// Adjustments of kinematic loops: captures whose images are explained by unknown poses, effects, cameras and targets
// that they share, and by poses of their own. The loops of a problem's captures are made by capture_loops.h.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "heba/data/free_parameters.h"
#include "heba/data/pair_problem.h"
#include "heba/data/pair_solution.h"
#include "heba/data/unknowns.h"
#include "solvers/residuals/kinematic_loop.h"

namespace heba {

// One image of a capture: the points of one target in one camera.
struct LoopView {
  const Observations* observations = nullptr;
  KinematicLoop loop;  // Gives camera_from_target.
  int camera = 0;
  int target = 0;
  // The variance of the part of the residuals that another pose of the target in the camera would explain, relative to
  // that of the others: above 1 if the image as a whole has an error, beside that of each point (WeighPosePart).
  double pose_variance_ratio = 1;
};

// An unknown pose of one capture: the correction of a robot pose, or the pose of a target that nothing else determines.
struct NuisancePose {
  Rigid3d pose;  // The initial guess, or the point of linearisation.
  // Index of its prior in LoopProblem::priors; nothing if no prior is known.
  std::optional<size_t> prior;
  // The directions in which further random effects of the capture act on the pose, such as the noise of the joints: the
  // derivative of its tangent by them. They add columns to LinearisedView::by_effects, and their noise is part of the
  // prior.
  Matrix6X directions = Matrix6X(6, 0);
};

struct LoopCapture {
  std::vector<LoopView> views;
  std::vector<NuisancePose> nuisance_poses;
};

struct LoopProblem {
  // The shared unknowns in this order: all poses, all effects, all cameras, all targets. The index of a pose, effect,
  // camera or target counts the blocks of its owner.
  UnknownLayout layout;
  std::vector<const CameraModel*> cameras;
  // The pixel sigma of each camera, relative to the one that a solver is given; empty if all are that one.
  std::vector<double> pixel_sigma_ratios;
  std::vector<TargetShape> targets;  // The designed shapes; the points of the observations are the designed ones.
  // Priors of nuisance poses: W, such that W * LocalCoordinates(identity, pose) has unit covariance and mean zero.
  std::vector<Matrix6> priors;
  std::vector<LoopCapture> captures;
};

// Values of the shared unknowns, with the parameters that are held.
struct LoopValues {
  std::vector<Rigid3d> poses;
  std::vector<Eigen::VectorXd> effects;
  std::vector<std::vector<double>> cameras;  // All parameters of each camera.
  std::vector<TargetShape> targets;
};

// The numbers of one owner in a solver: a pose's block (heba/geometry/pose_block.h), effects, or all parameters of a
// camera or of a target's shape, free or not.
struct OwnerBlock {
  UnknownBlock unknowns;
  size_t index = 0;  // Index among the blocks of its kind of owner.
  size_t first = 0;  // Place of its first number if all blocks are joined.
  int size = 0;
};
// Returns the parameter blocks of a layout, in its order. Targets whose shape is known have none.
std::vector<OwnerBlock> ParameterBlocksOf(const UnknownLayout& layout);
// Returns the joined numbers of these blocks.
std::vector<double> JoinedBlocks(const std::vector<OwnerBlock>& blocks, const LoopValues& values);
// Returns the values in the joined blocks, with unit quaternions. The shapes of targets without a block are those of
// `held`.
LoopValues ValuesIn(const std::vector<OwnerBlock>& blocks, const std::vector<double>& joined,
                    const std::vector<TargetShape>& held);

// Returns the pixel sigma of a camera, given the one that LoopProblem::pixel_sigma_ratios refers to.
double PixelSigmaOf(const LoopProblem& problem, size_t camera, double pixel_sigma_px);

// Returns the flags with which the points of a target in a camera are reduced (ViewReducer).
FreeParameters FreeOf(const LoopProblem& problem, int camera, int target);

// The square root W of the information about nuisance poses that are robot corrections of this noise: W^T W is the
// inverse of Q = sigma_t^2 P_t + sigma_r^2 P_r + sigma_joint^2 J J^T, where J is View::gripper_by_joints.
Matrix6 CorrectionPrior(const RobotNoise& noise, const Matrix6X& gripper_by_joints = Matrix6X(6, 0));

// Six whitened residuals of a nuisance pose with its prior, and their derivatives by the tangent of the pose.
struct NuisancePoseResidual {
  Tangent6 residual;
  Matrix6 by_tangent;
};
NuisancePoseResidual NuisancePoseResidualAt(const Rigid3d& pose, const Matrix6& prior);

// The indices of views that are one capture because they were taken at one robot pose.
using PoseGroups = std::vector<std::vector<size_t>>;

// Returns the loop of one capture of a hand-eye calibration: X^-1 M E Exp(xi) Z if the target is on the gripper,
// X^-1 Exp(-xi) E^-1 M Z if the camera is. The shared poses are X and Z, E is `effect` of the effects 0 if it is not
// null, and xi the capture's nuisance pose 0 if `has_correction`.
KinematicLoop HandEyeLoop(Setup setup, const Rigid3d& camera_mount_from_target_mount,
                          std::shared_ptr<const PoseEffect> effect, bool has_correction);

}  // namespace heba
