// The estimation problem of one camera, one target and one arm. It is independent of images, files and robot brands.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "heba/camera/camera.h"
#include "heba/data/capture_role.h"
#include "heba/data/observations.h"
#include "heba/data/setup.h"
#include "heba/data/shared_effects.h"
#include "heba/data/target_shape.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// The detections of one capture, with the robot's pose.
struct View {
  std::string name;  // Name of the capture.
  Rigid3d camera_mount_from_target_mount;
  Observations observations;
  CaptureRole role = CaptureRole::kNone;
  size_t capture = 0;  // Index of the capture in the caller's list. The solvers hand it on and do not use it.
  // The error of the robot's pose, gripper_from_corrected_gripper, as a function of effects that captures share; null
  // if none is modelled.
  std::shared_ptr<const PoseEffect> effect = {};
  // The derivative of the gripper's pose (Tangent6, in its own frame) by the positions of the joints, if the noise of
  // the joints is part of the robot noise; otherwise empty.
  Matrix6X gripper_by_joints = Matrix6X(6, 0);
  // The recorded positions of the joints, rad or m; empty if they are not known. An arm that reaches one pose in
  // several postures has another error in each.
  std::vector<double> joints = {};
};

struct UnusedView {
  std::string name;
  size_t capture = 0;  // View::capture.
  std::string reason;
};

// Returns the views with every point moved to its actual position.
std::vector<View> ApplyShape(const std::vector<View>& views, const TargetShape& shape);

// The views, and everything else that a refinement needs.
struct PairProblem {
  Camera camera;
  std::vector<View> views;
  // Determines which frame of the loop is the gripper. Robot noise, if it is modelled, acts in the gripper's frame.
  Setup setup = Setup::kEyeToHand;
  // The designed shape, to which the points of the views correspond.
  TargetShape shape = {};
};

// The unknown poses. Results call camera_mount_from_camera `hand_eye` and target_mount_from_target `board`.
struct HandEye {
  Rigid3d camera_mount_from_camera;
  Rigid3d target_mount_from_target;
};

// Returns camera_mount_from_target_mount with the robot's pose corrected by gripper_from_corrected_gripper.
inline Rigid3d CorrectedMount(Setup setup, const Rigid3d& camera_mount_from_target_mount, const Rigid3d& correction) {
  return setup == Setup::kEyeToHand ? camera_mount_from_target_mount * correction
                                    : Inverse(correction) * camera_mount_from_target_mount;
}

inline Rigid3d CameraFromTarget(const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount) {
  return Inverse(hand_eye.camera_mount_from_camera) * camera_mount_from_target_mount *
         hand_eye.target_mount_from_target;
}

}  // namespace heba
