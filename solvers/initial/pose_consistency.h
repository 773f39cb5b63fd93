// Tests whether the robot poses and the target poses seen in the images are consistent at all, even if some of them
// are wrong. Distinguishes possible interpretations of a data set (tools/doctor).
#pragma once

#include <optional>
#include <vector>

#include "heba/data/pair_problem.h"

namespace heba {

// One capture: the robot pose, and the candidates for the target pose in the image (the two poses of a planar target,
// the rotations under which the target looks the same). Likelier candidates come first; there must be at least one.
struct PoseCandidates {
  Rigid3d camera_mount_from_target_mount;
  std::vector<Rigid3d> camera_from_target;
};

struct PoseConsistency {
  // The solution that explains most captures best. Its translations are in metres of the camera's scale, which is
  // that of the target.
  HandEye hand_eye;
  // Factor from the robot's translations to those of the camera, and its sigma: 1 if the units and the size of the
  // target are correct. Exactly 1 and 0 if the scale was not free.
  double robot_scale = 1;
  double robot_scale_stddev = 0;
  // For each capture, with the best candidate: the angle between the two paths from the target to the camera's mount,
  // the distance between them, and both combined as a distance at the target.
  std::vector<double> rotation_rad;
  std::vector<double> translation_m;
  std::vector<double> misfit_m;
  // For each capture, the index of the best candidate.
  std::vector<size_t> candidate;
  // 70 % quantiles over the captures.
  double typical_rotation_rad = 0;
  double typical_translation_m = 0;
  double typical_misfit_m = 0;
};

enum class RobotScale { kOne, kFree };

// Returns X and Z of X C_i = M_i Z (solvers/closed_form/hand_eye_method.h) with the smallest 70 % quantile of the
// misfits over random triples of captures (P. Rousseeuw, "Least median of squares regression", JASA 79, 1984).
// Rotations are estimated first, then translations, and each is re-estimated from the captures that fit. The result
// is deterministic. If the motion leaves a part of X undetermined, one of the solutions is returned; the misfits are
// valid nevertheless. Returns nothing for fewer than five captures.
std::optional<PoseConsistency> FindPoseConsistency(const std::vector<PoseCandidates>& captures, RobotScale scale);

}  // namespace heba
