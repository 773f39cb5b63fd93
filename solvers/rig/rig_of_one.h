// The calibration of a single camera as that of a rig with one camera, one target and one arm.
#pragma once

#include "heba/calibration.h"
#include "solvers/rig/rig_rejection.h"

namespace heba {

struct RigOfOne {
  // The captures are in the order of View::capture, and have one image each. Those that the calibration left out
  // because they contradict the others are among them; those without a pose of the target are not.
  RigProblem problem;
  std::vector<size_t> captures;  // View::capture of each.
  // The solution holds the poses, the camera, the shape and the effects that the calibration found.
  JudgedRig judged;
};

// Returns the rig of a calibration whose refinement succeeded; `options` are those of the calibration. Its camera and
// its arm have no name.
RigOfOne AsRig(const Calibration& calibration, const CalibrationOptions& options);

}  // namespace heba
