// The initial guess of a rig: calibrations of pairs of a camera and a target, joined over a spanning tree.
#pragma once

#include <vector>

#include "heba/base/error.h"
#include "heba/calibration_types.h"

namespace heba {

// Estimates the cameras that are not given, each from all its images. Returns a Failure that names a camera or target
// without images, or a camera that cannot be estimated.
Outcome<std::vector<Camera>> EstimateCameras(const Problem& problem, const CalibrationOptions& options);

// Calibrates every pair of a camera and a target that one arm moves against each other (CalibratePair), with the robot
// taken as exact. View::capture of their views is the index of the capture.
std::vector<CalibratedPair> CalibratePairs(const Problem& problem, const CalibrationOptions& options);

// Joins the poses of the cameras, targets and bases. A spanning tree of the best determined ones takes the calibrations
// of the pairs that one arm moves, and the pose of the target in the images of the pairs that nothing moves. Where it
// ends, single images place parts of which the images show nothing else that is unknown, until nothing changes.
//
// A symmetric target has one orientation in the whole rig. Where its images allow several poses of a camera or base,
// all are followed until other images contradict them.
//
// Returns a Failure that names a camera, target or arm that is not reached, or one for which several poses remain.
Outcome<CellPoses> JoinPairs(const Problem& problem, const std::vector<CalibratedPair>& pairs);

// Returns the problem with the points of symmetric targets read in the order that fits the poses best, in every image.
Problem InChosenOrders(Problem problem, const CellPoses& poses);

}  // namespace heba
