// A hand-eye calibration in the form of several cameras, targets and arms: one of each, without names.
#pragma once

#include "heba/data/pair_solution.h"
#include "heba/data/problem.h"
#include "heba/data/setup.h"
#include "heba/data/solution.h"

namespace heba {

// Returns the setup of a camera on this mount: eye-in-hand if a gripper carries it.
inline Setup SetupOf(const Mount& camera_mount) {
  return camera_mount.part == Mount::Part::kGripper ? Setup::kEyeInHand : Setup::kEyeToHand;
}

// Returns the arm, the camera and the target of a setup, without captures. The world is the base of the arm.
Problem HandEyeProblem(Setup setup, const Camera& camera, const TargetShape& shape);
// Returns the problem of a solution, with the effects that it has estimated and without captures.
Problem HandEyeProblem(Setup setup, const PairSolution& solution);

CellPoses HandEyePosesOf(const HandEye& hand_eye);
// Returns a solution as that of such a problem.
Solution ProblemSolution(const PairSolution& solution);

}  // namespace heba
