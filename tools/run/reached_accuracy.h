// The accuracy with which cameras locate targets: where they were seen, and where the config requires one.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/data/problem.h"
#include "heba/data/solution.h"
#include "heba/evaluation/run_result.h"
#include "heba/run_types.h"

namespace heba {

// Returns the working point of each camera: the middle of the target in the image in which it has the median distance.
// Nothing for a camera without an image that determines the pose of its target. `used` has the images and points that
// the solution uses. `changes`, as of Advice, are those that the covariance of the solution does not have yet: what a
// wrong held part does to the camera and to what the camera sees cancels in part, so that a located target moves by as
// much as the target of the calibration.
std::vector<std::optional<WorkingPoint>> WorkingPointsOf(const Problem& used, const Solution& solution,
                                                         const std::vector<Eigen::VectorXd>& changes);

// Returns what is reached for each requirement and each camera that it concerns: the one that it names, or all. A
// position concerns the fixed cameras that see it, or all fixed cameras if none does. A camera on a gripper, which can
// see a target at any position as there, and every camera if no position is required, is judged at its working point
// (WorkingPointsOf).
std::vector<CameraRequirement> ReachedAccuracies(const std::vector<PlacedRequirement>& requirements,
                                                 const Problem& used, const Solution& solution,
                                                 const std::vector<std::optional<WorkingPoint>>& working_points);

}  // namespace heba
