// The limits by which results are graded. Accuracy is stated and not graded, unless a requirement grades it: the limits
// of errors are shares of the distance between camera and target, far beyond what a sound cell reaches.
#pragma once

#include <vector>

#include "heba/evaluation/finding.h"

namespace heba {

// A figure up to `doubtful` is graded good, up to `bad` doubtful, and above it bad.
struct Limits {
  double doubtful;
  double bad;
};

// Errors of a target's position as shares of its distance from the camera, and errors of orientations in rad, which
// move the target by that share. A requirement (RunResult::requirements) replaces them. What the robot's noise
// explains is bad only beyond kUseless.
inline constexpr Limits kSigmaShare = {0.003, 0.015};
inline constexpr Limits kHeldOutShare = {0.005, 0.02};
inline constexpr double kUseless = 0.1;
// The robot's noise explains sigmas up to so many times what it leaves in the mean of the captures: well distributed
// captures leave one to three times as much.
inline constexpr double kTimesMean = 6;
// It explains held-out errors up to so many times the error of one capture.
inline constexpr double kTimesRobotError = 2;
// A target at an unknown distance counts as one at this distance.
inline constexpr double kUsualDistanceM = 0.5;
// The errors of arms do not shrink with the distance: a nearer target counts as one at this distance.
inline constexpr double kLeastDistanceM = 0.2;
inline constexpr Limits kHeldOutChi2 = {1.5, 3};  // Per degree of freedom; 1 if the model is right.
inline constexpr Limits kPixelSigmaPx = {1, 5};
inline constexpr Limits kShareLeftOut = {0.1, 0.6};  // Share of the captures that show the target.
inline constexpr int kFewCaptures = 8;

inline Grade GradeOf(double value, const Limits& limits) {
  if (!(value <= limits.bad)) return Grade::kBad;
  return value <= limits.doubtful ? Grade::kGood : Grade::kDoubtful;
}

}  // namespace heba
