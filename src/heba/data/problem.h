// What is solved. A Problem knows no image, no file and no robot brand.
#pragma once

#include <string>
#include <vector>

#include "heba/camera/camera.h"
#include "heba/data/setup.h"
#include "heba/data/target_shape.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// Points of the target, found in one image. Column i of both matrices and ids[i] belong together.
struct Observations {
  std::vector<int> ids;      // The target's point ids.
  Points3 points_in_target;  // m
  Points2 pixels;            // px, (0, 0) is the centre of the first pixel
  // Of the discs (TargetPoint::radius_m) around the points; empty if all are points.
  Eigen::VectorXd radii_m;
  // Detection::covariances_px2; empty if the detector did not say.
  std::vector<Eigen::MatrixXd> covariances_px2;
  // Lower triangular matrices, one for each of the covariances: residuals multiplied by them are uncorrelated and have
  // one common sigma (solvers/residuals/noise_scale.h). Empty: all coordinates count alike.
  std::vector<Eigen::MatrixXd> whitening;

  double RadiusM(Eigen::Index i) const { return radii_m.size() > 0 ? radii_m[i] : 0; }
  int size() const { return static_cast<int>(ids.size()); }
};

struct View {
  std::string name;  // The capture's.
  Rigid3d camera_mount_from_target_mount;
  Observations observations;
  std::string role = {};  // As PosePair::role.
};

struct Problem {
  Camera camera;
  std::vector<View> views;
  // Where the gripper is in the chain: the robot's noise, if it is modelled, acts in its frame.
  Setup setup = Setup::kEyeToHand;
  // Of which the views' points are as designed.
  TargetShape shape = {};
};

// The unknowns. hand_eye in results is camera_mount_from_camera, board is target_mount_from_target.
struct HandEye {
  Rigid3d camera_mount_from_camera;
  Rigid3d target_mount_from_target;
};

inline Rigid3d CameraFromTarget(const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount) {
  return Inverse(hand_eye.camera_mount_from_camera) * camera_mount_from_target_mount *
         hand_eye.target_mount_from_target;
}

}  // namespace heba
