// The estimation problem. A Problem is independent of images, files and robot brands.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "heba/camera/camera.h"
#include "heba/data/capture_role.h"
#include "heba/data/setup.h"
#include "heba/data/shared_effects.h"
#include "heba/data/target_shape.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// Points of the target that were detected in one image. Column i of both matrices and ids[i] belong together.
struct Observations {
  std::vector<int> ids;      // Ids of the target's points.
  Points3 points_in_target;  // Metres.
  Points2 pixels;            // px; (0, 0) is the centre of the first pixel.
  // Radii of the discs around the points (TargetPoint::radius_m), in metres; empty if all of them are points.
  Eigen::VectorXd radii_m;
  // Covariances of the detected pixels (Detection::covariances_px2); empty if the detector does not provide them.
  std::vector<Eigen::MatrixXd> covariances_px2;
  // Lower triangular whitening matrices, one for each covariance: residuals multiplied by them are uncorrelated and
  // have one common sigma (solvers/residuals/noise_scale.h). If empty, all coordinates have the same weight.
  std::vector<Eigen::MatrixXd> whitening;

  double RadiusM(Eigen::Index i) const { return radii_m.size() > 0 ? radii_m[i] : 0; }
  int size() const { return static_cast<int>(ids.size()); }
};

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

// The views, and everything else that a refinement needs.
struct Problem {
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
