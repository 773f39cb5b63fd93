// What of a result is known worst, in plain words, and which further captures would help most.
#pragma once

#include <string>
#include <vector>

#include "heba/data/solution.h"
#include "solvers/information.h"

namespace heba {

// One sentence for each part of the result whose one sigma exceeds what a cell usually needs (1 mm, 0.1 deg, 0.2 % of
// the focal length, 0.2 % of the image's width for its centre): the direction in which it is known worst, along the
// axis of a frame where it is near one, how well, and the motion that would better it most, with what it would become.
// The motions are tried: two more captures of each kind (board tilted about its axes, turned in its plane, nearer and
// farther, towards the picture's sides), from the middle one of the captures, by what their points would add to the
// normal matrix. Worst first; empty if all is well known.
std::vector<std::string> AdviseOnCaptures(const Problem& problem, const Solution& solution, const FreeParameters& free);

// Of a solution that takes the robot's poses as exact: one sentence if the captures say (by restricted maximum
// likelihood, solvers/robot_noise.h) that the robot's noise moves the points by more than the pixels' own noise does,
// with its size; empty if not. The solution's covariance is then too small.
std::string AdviseOnRobot(const Problem& problem, const Solution& solution, const FreeParameters& free);

// Of a solution that takes the target's shape as designed: one sentence if the captures say otherwise beyond doubt
// (F-test of the shape's parameters, with the pixels' and the robot's noise both found from the captures) and by enough
// to matter, with the shape that they see; empty if not. `free` is what was given and, if there is a sentence, what of
// the shape the captures show.
struct TargetAdvice {
  std::string sentence;
  FreeParameters free;
};
TargetAdvice AdviseOnTarget(const Problem& problem, const Solution& solution, const FreeParameters& free);

}  // namespace heba
