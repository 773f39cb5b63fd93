// Finds the directions in which each camera of a rig is known least, and the captures that would determine it better.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/rig_calibration.h"
#include "solvers/calibration/weak_directions.h"

namespace heba {

// Returns the directions in which the pose of a camera in its mount and its free intrinsics are known least, the worst
// first.
std::vector<WeakDirection> DirectionsOfCamera(const RigProblem& problem, const RigSolution& solution, size_t camera);

// Two additional captures of a rig: a motion of a target in a camera that one arm makes, starting from a capture, while
// the other arms stay.
struct RigCandidate {
  size_t camera = 0;
  size_t target = 0;
  size_t robot = 0;
  size_t capture = 0;
  CandidateMotion motion;
  std::vector<RigCapture> captures;  // With everything that the cameras would see, without noise.
};

// Returns candidates from a few captures of every pair of a camera and a target that an arm moves. In them, a camera
// sees a target that it saw in an image in use if all points lie in the image or as many as in one of these images,
// and if the target shows the same side, is not seen more obliquely and is not much farther away than in these images.
// `used` has the points in use.
std::vector<RigCandidate> FindRigCandidates(const RigProblem& used, const RigSolution& solution);

// Returns one sigma of each direction if a candidate were captured, too; nothing if a point would have no image.
std::optional<std::vector<double>> SigmasWith(const RigProblem& used, const RigSolution& solution,
                                              const RigCandidate& candidate,
                                              const std::vector<WeakDirection>& directions);

}  // namespace heba
