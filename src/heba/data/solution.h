// The result of the adjustment of a problem and its uncertainty.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "heba/data/pair_solution.h"
#include "heba/data/problem.h"
#include "heba/data/unknowns.h"

namespace heba {

// The outcome for one capture.
struct CaptureOutcome {
  // The corrections of the arms' poses (gripper_from_corrected_gripper); empty if the arms are exact.
  std::vector<Rigid3d> corrections;
  // One per image of the capture: the ids of the points that were rejected because they contradict the others.
  std::vector<std::vector<int>> rejected_ids;
};

struct Solution {
  CellPoses poses;
  std::vector<Camera> cameras;
  std::vector<TargetShape> shapes;
  std::vector<double> pixel_sigmas_px;  // One sigma of each pixel coordinate of each camera.
  // One sigma of an error of each image of a camera as a whole, which acts like another pose of the target: it moves
  // each point by as much (RMS). It is told from the noise of an arm by captures with several images.
  std::vector<double> image_sigmas_px;
  std::vector<std::optional<double>> unmodelled_sigma_px;  // PairSolution::unmodelled_sigma_px of each camera.
  // The noise of each arm and, if it was estimated, one sigma of each of its sigmas; nothing for an arm that moves no
  // target against a camera, and for exact arms.
  std::vector<std::optional<RobotNoise>> robot_noise;
  std::vector<std::optional<RobotNoise>> robot_noise_stddev;
  // One for each arm: the estimates of its effects (Problem::effects) and the standard deviation of each of their
  // groups. Empty lists: no arm has any.
  std::vector<Eigen::VectorXd> effects;
  std::vector<std::vector<double>> effect_sigmas;
  // One for each arm: the standard deviations of errors that vary smoothly with its pose (heba/data/smooth_errors.h),
  // nothing if they are not estimated; see SmoothNoiseOf.
  std::vector<std::optional<RobotNoise>> smooth_noise;
  std::vector<CaptureOutcome> captures;  // One per capture of the problem.
  // The blocks are called as the objects of a result file: "cameras.NAME.pose", "cameras.NAME.camera",
  // "targets.NAME.pose", "targets.NAME.shape", "robots.NAME.world_from_base" and "robots.NAME.errors". The tangents of
  // poses are on the right, translation before rotation.
  Covariance covariance;
  Covariance covariance_repeatable;                                 // See PairSolution::covariance_repeatable.
  double covariance_dof = std::numeric_limits<double>::infinity();  // See PairSolution::covariance_dof.
  Convergence convergence;
};

// Returns the smooth noise of an arm; nothing if it has none.
std::optional<RobotNoise> SmoothNoiseOf(const Solution& solution, size_t robot);

// The names of a problem's blocks of unknowns, which are those of a hand-eye calibration for what has no name.
std::string CameraPoseBlock(const ProblemCamera& camera);
std::string CameraBlock(const ProblemCamera& camera);
std::string TargetPoseBlock(const ProblemTarget& target);
std::string TargetShapeBlock(const ProblemTarget& target);
std::string BaseBlock(const std::string& robot);
std::string ErrorsBlock(const std::string& robot);

// Returns the layout of a problem's unknowns: the poses of the cameras, of the targets and of all bases but the first,
// the effects of the arms, and the free parameters of the cameras and of the targets' shapes, in that order.
UnknownLayout UnknownsOf(const Problem& problem);
// Returns the solution with no other effects of the arms than those of `problem`, which is the one that was solved but
// for effects that it lacks: what remains of the covariance is that of the other unknowns.
Solution WithEffectsOf(const Problem& problem, Solution solution);

// A pose with the derivative of its tangent (m, rad, in the child frame) by the unknowns of a layout.
struct PoseByUnknowns {
  Rigid3d pose;
  Matrix6X by_unknowns;
};
// Returns the pose of an unknown pose; the identity if the layout has no block of this name.
PoseByUnknowns UnknownPose(const Rigid3d& pose, const UnknownLayout& layout, const std::string& block);
PoseByUnknowns Inverse(const PoseByUnknowns& a_from_b);
PoseByUnknowns operator*(const PoseByUnknowns& a_from_b, const PoseByUnknowns& b_from_c);

// The pose of one camera in another (or of one target or base), and its covariance (m, rad, in the child frame).
struct RelativePose {
  std::string parent;
  std::string child;
  Rigid3d parent_from_child;
  Eigen::Matrix<double, 6, 6> covariance;
};
// Return the poses of all cameras, and of all targets, in the world or, if a gripper carries them, in that gripper, and
// the poses of all bases but the first in the world. `parent` is "world" or MountText of the gripper.
std::vector<RelativePose> CameraPoses(const Problem& problem, const Solution& solution);
std::vector<RelativePose> TargetPoses(const Problem& problem, const Solution& solution);
std::vector<RelativePose> BasePoses(const Problem& problem, const Solution& solution);
// Return the poses of all pairs of cameras, of targets and of bases whose relative pose is constant: those on one
// gripper, or both on bases. The covariance is that of the pose itself; it is smaller than the sum of those of its two
// ends, which are correlated.
std::vector<RelativePose> RelativeCameraPoses(const Problem& problem, const Solution& solution);
std::vector<RelativePose> RelativeTargetPoses(const Problem& problem, const Solution& solution);
std::vector<RelativePose> RelativeBasePoses(const Problem& problem, const Solution& solution);

}  // namespace heba
