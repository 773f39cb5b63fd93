// Finds the directions in which each camera of a problem is known least, and the captures that would determine it
// better.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/adjustment_options.h"
#include "heba/data/pair_problem.h"
#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "solvers/calibration/weak_directions.h"

namespace heba {

// Returns the directions in which the pose of a camera in its mount and its free intrinsics are known least, the worst
// first. Those of the targets' poses are among them if there is one camera.
std::vector<WeakDirection> DirectionsOfCamera(const Problem& problem, const Solution& solution, size_t camera);

// Two additional captures: a motion of a target in a camera that one arm makes, starting from a capture, while
// the other arms stay.
struct CandidateCaptures {
  size_t camera = 0;
  size_t target = 0;
  size_t robot = 0;
  size_t capture = 0;
  CandidateMotion motion;
  std::vector<ProblemCapture> captures;  // With everything that the cameras would see, without noise.
};

// Returns candidates from a few captures of every pair of a camera and a target that an arm moves. In them, a camera
// sees a target that it saw in an image in use if all points lie in the image or as many as in one of these images,
// and if the target shows the same side, is not seen more obliquely and is not much farther away than in these images.
// `used` has the points in use.
std::vector<CandidateCaptures> FindCandidates(const Problem& used, const Solution& solution);

// Returns one sigma of each direction if a candidate were captured, too; nothing if a point would have no image, or if
// the covariance of the solution is not positive.
std::optional<std::vector<double>> SigmasWith(const Problem& used, const Solution& solution,
                                              const CandidateCaptures& candidate,
                                              const std::vector<WeakDirection>& directions);

// Returns a finding `weak_direction` for each camera, named `of_camera` if cameras have names: the directions of which
// the sigma exceeds what a robot cell usually needs (1 mm, 0.1 deg, 0.2 % of the focal length, 0.2 % of the image width
// for the principal point), the worst first, or the worst one if none does. It has a part `weak_direction_of` for each
// direction (named by a frame's axis if it is close to one) with its sigma, and a part `suggested_captures` for the
// candidate that would reduce the worst sigma most, with the sigma expected then, unless none reduces it much.
std::vector<Finding> DiagnoseDirections(const Problem& used, const Solution& solution);
// Returns that finding for a hand-eye calibration; nothing if no direction is weak.
std::optional<Finding> DiagnoseWeakDirections(const PairProblem& problem, const PairSolution& solution,
                                              const BundleOptions& options);

}  // namespace heba
