// The estimation problem: any number of cameras, targets and arms, which are calibrated in one adjustment. It is
// independent of images, files and robot brands. The world is the base of the first arm.
//
// In capture i, camera c sees target t from
//   camera_from_target = inv(mount_from_camera_c) * inv(world_from_mount(c)) * world_from_mount(t) *
//   mount_from_target_t
// where world_from_mount is world_from_base of an arm or, for a mount on its gripper,
// world_from_base * base_from_gripper_i * error_i * correction_i: error_i is a function of effects that all captures
// share, if the arm has any (heba/data/shared_effects.h), and correction_i is that of this capture alone.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "heba/camera/camera.h"
#include "heba/data/camera_prior.h"
#include "heba/data/pair_problem.h"
#include "heba/data/scale_sigmas.h"
#include "heba/data/shared_effects.h"
#include "heba/data/target_shape.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// The part of an arm that carries a camera or a target. What stands beside the arms is on the base of the first one.
struct Mount {
  enum class Part { kBase, kGripper };
  size_t robot = 0;  // Index in Problem::robots.
  Part part = Part::kBase;

  bool operator==(const Mount& other) const = default;
};

// A camera of a problem.
struct ProblemCamera {
  std::string name;
  Mount mount;
  Camera camera;
  // The groups of its parameters that are unknown.
  std::vector<ParameterGroup> free_intrinsics = {};
  std::string mount_name = {};            // The mount as the user calls it; empty: MountText.
  std::optional<CameraPrior> prior = {};  // Prior knowledge of its free parameters.
};

// A target of a problem.
struct ProblemTarget {
  std::string name;
  Mount mount;
  TargetShape shape;                              // The shape is as designed.
  std::vector<TargetShapeGroup> free_shape = {};  // The groups of its shape that are unknown.
  // The motions that map the target to itself, the identity first.
  std::vector<Rigid3d> symmetries = {Rigid3d()};
  std::string mount_name = {};  // ProblemCamera::mount_name.
  // One sigma of each scale of its shape, about that of the design, as prior knowledge that the estimate uses; nothing
  // if it uses none, because no systematic error of an arm acts like another scale.
  std::optional<double> scale_sigma = {};
  double known_scale_sigma = kTargetScaleSigma;  // One sigma of each scale, used or not.
};

// The points of one target in one camera.
struct ProblemImage {
  size_t camera = 0;
  size_t target = 0;
  Observations observations;
};

// The joints of an arm at a capture, as far as they are known.
struct ArmPosture {
  // The derivative of the gripper's pose (Tangent6, in its own frame) by the positions of the joints, if the noise of
  // the joints is part of the arm's noise; otherwise empty.
  Matrix6X gripper_by_joints = Matrix6X(6, 0);
  // The recorded positions of the joints, rad or m; empty if they are not known. An arm that reaches one pose in
  // several postures has another error in each.
  std::vector<double> joints = {};
};

struct JointPrior;  // heba/data/joint_prior.h

// The images that were taken at one pose of every arm. A camera that saw nothing has no entry.
struct ProblemCapture {
  std::string name;
  std::vector<Rigid3d> base_from_gripper;  // One for each arm, as it reports it.
  std::vector<ProblemImage> images;
  // One for each arm: its error as a function of the effects that are estimated, null if there are none. An empty list:
  // no arm has any.
  std::vector<std::shared_ptr<const PoseEffect>> effects = {};
  // One for each arm. An empty list: nothing is known about any joint.
  std::vector<ArmPosture> postures = {};
};

// One camera, one target and one arm may have empty names: their blocks of unknowns are then called as those of a
// hand-eye calibration (heba/data/unknowns.h).
struct Problem {
  std::vector<std::string> robots;  // The names of the arms.
  std::vector<ProblemCamera> cameras;
  std::vector<ProblemTarget> targets;
  std::vector<ProblemCapture> captures;
  // One for each arm: the effects that its captures share, null if there are none. An empty list: no arm has any.
  std::vector<std::shared_ptr<const SharedEffects>> effects = {};
  std::shared_ptr<const JointPrior> prior = {};  // The prior is null without an earlier session.
};

// Returns the effects of an arm; null if it has none.
const SharedEffects* EffectsOf(const Problem& problem, size_t robot);

// Returns the mount that a text means: "world", "NAME.base" and "NAME.gripper" and, if there is one arm, "base" and
// "gripper". Returns nothing if there is no such mount.
std::optional<Mount> FindMount(const std::vector<std::string>& robots, const std::string& text);
// Returns the texts of all mounts.
std::vector<std::string> MountTexts(const std::vector<std::string>& robots);
// Return the text of a mount, which is that of the user if there is one.
std::string MountText(const std::vector<std::string>& robots, const Mount& mount);
std::string MountText(const Problem& problem, const ProblemCamera& camera);
std::string MountText(const Problem& problem, const ProblemTarget& target);

// The constant poses of the cameras, targets and arms of a problem.
struct CellPoses {
  std::vector<Rigid3d> mount_from_camera;
  std::vector<Rigid3d> mount_from_target;
  std::vector<Rigid3d> world_from_base;  // One for each arm; the first is the identity.
};

// Returns whether the pose of one mount in the other changes when an arm moves.
bool MovesAgainst(const Mount& a, const Mount& b);
// Returns whether `robot` moves one of the mounts against the other.
bool IsMovedBy(const Mount& a, const Mount& b, size_t robot);

// Returns the pose of a mount in the world. `base_from_gripper` has one pose for each arm.
Rigid3d WorldFromMount(const Mount& mount, const std::vector<Rigid3d>& world_from_base,
                       const std::vector<Rigid3d>& base_from_gripper);
// Returns camera_from_target for these poses of the arms.
Rigid3d CameraFromTarget(const Problem& problem, const CellPoses& poses, size_t camera, size_t target,
                         const std::vector<Rigid3d>& base_from_gripper);

// Returns the pose of an arm at which a camera sees a target from `camera_from_target`; one of the two is on its
// gripper, and the other arms stand at `base_from_gripper`.
Rigid3d PoseOfArm(const Problem& problem, const CellPoses& poses, size_t camera, size_t target, size_t robot,
                  const std::vector<Rigid3d>& base_from_gripper, const Rigid3d& camera_from_target);

// Returns the poses of the arms as they report them, multiplied by their errors at these effects, one vector for each
// arm; an empty list stands for no effects.
std::vector<Rigid3d> WithErrors(const ProblemCapture& capture, const std::vector<Eigen::VectorXd>& effects);
// Returns camera_from_target of the images of a camera that have points, with the errors of the arms.
std::vector<Rigid3d> TargetPosesOf(const Problem& problem, const CellPoses& poses,
                                   const std::vector<Eigen::VectorXd>& effects, size_t camera);

// Returns the poses of the arms multiplied by their corrections (gripper_from_corrected_gripper); an empty list stands
// for none.
std::vector<Rigid3d> Corrected(const std::vector<Rigid3d>& base_from_gripper, const std::vector<Rigid3d>& corrections);

}  // namespace heba
