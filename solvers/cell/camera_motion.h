// Finds a camera that was moved on its mount during the captures.
#pragma once

#include <optional>
#include <string>

#include "heba/calibration_types.h"
#include "heba/evaluation/finding.h"
#include "solvers/cell/rejection.h"

namespace heba {

// The most motions that are searched for, one after the other.
inline constexpr int kMostMotions = 5;

// Looks for the camera of which the images before a capture and those from it on show two poses that differ clearly:
// the pose of the camera according to each image jumps (the two-sample statistic of Hotelling, "The generalization of
// Student's ratio", 1931, over all captures), by three times its scatter or more, and an adjustment with one camera
// before the jump and another one after it states poses that differ at 1e-6, by three times the errors of the arms or
// more, and leaves out few of their images.
//
// `problem` has the points of all images, `judged` is its adjustment. Returns nothing if no camera was moved, and the
// clearest motion if several were. The captures before the motion are left out, or those after it if these are not
// more.
std::optional<MovedCamera> FindMovedCamera(const Problem& problem, const JudgedProblem& judged,
                                           const AdjustmentOptions& options);

// Returns why the images of MovedCamera::left_out are not used.
std::string WhyLeftOut(const Problem& problem, const MovedCamera& moved);

// The finding `camera_moved`.
Finding DescribeMotion(const Problem& problem, const MovedCamera& moved);

}  // namespace heba
