// Whether the robot's poses and the poses that pictures show of the target belong together at all, though a part of
// them be wrong: what tells the readings of a data set apart (tools/doctor).
#pragma once

#include <optional>
#include <vector>

#include "heba/data/problem.h"

namespace heba {

// One capture: the robot's pose, and what the picture leaves open of the target's (the two poses of a plane, the turns
// under which a board looks the same), likelier ones first; at least one.
struct PoseCandidates {
  Rigid3d camera_mount_from_target_mount;
  std::vector<Rigid3d> camera_from_target;
};

struct PoseConsistency {
  // What explains most captures best. Its translations are in the camera's metres.
  HandEye hand_eye;
  // The robot's translations times this are the camera's: 1 if units and the target's size are right; and its sigma.
  // Exactly 1, and 0, if it was not free.
  double robot_scale = 1;
  double robot_scale_stddev = 0;
  // Of each capture, by the candidate that fits best: angle between the two ways from the target to the camera's mount,
  // distance between them, and both as a distance at the target.
  std::vector<double> rotation_rad;
  std::vector<double> translation_m;
  std::vector<double> misfit_m;
  // Of the candidates, the one that fits best.
  std::vector<size_t> candidate;
  // What seven tenths of the captures stay below.
  double typical_rotation_rad = 0;
  double typical_translation_m = 0;
  double typical_misfit_m = 0;
};

enum class RobotScale { kOne, kFree };

// X and Z of X C_i = M_i Z (solvers/closed_form/hand_eye_method.h) such that seven tenths of the captures fit as well
// as can be: least quantile of the misfits over random triples of captures (P. Rousseeuw, "Least median of squares
// regression", JASA 79, 1984), rotations first, then translations, each solved again from the captures that fit.
// Deterministic. A motion that leaves a part of X open gives one of the solutions: the misfits mean the same. Nothing
// for fewer than five captures.
std::optional<PoseConsistency> FindPoseConsistency(const std::vector<PoseCandidates>& captures, RobotScale scale);

}  // namespace heba
