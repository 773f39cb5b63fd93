// The initial guess of a rig: calibrations of pairs of a camera and a target, joined over a spanning tree.
#pragma once

#include <vector>

#include "heba/base/error.h"
#include "heba/rig_calibration.h"

namespace heba {

// Estimates the cameras that are not given, each from all its images.
Outcome<std::vector<Camera>> EstimateRigCameras(const RigProblem& problem, const RigCalibrationOptions& options);

// Calibrates every pair of a camera and a target that one arm moves against each other (Calibrate), with the robot
// taken as exact. View::capture of their views is the index of the capture.
std::vector<RigPair> CalibratePairs(const RigProblem& problem, const RigCalibrationOptions& options);

// Joins the poses of the pairs: those that one arm moves by their calibrations, those that nothing moves by the pose of
// the target in one image. A spanning tree takes the best determined ones. Returns a Failure that names a camera,
// target or arm that is not reached.
Outcome<RigPoses> JoinPairs(const RigProblem& problem, const std::vector<RigPair>& pairs);

// Reads the points of symmetric targets in the order that fits the poses best, in every image.
void ChooseReadingOrders(const RigPoses& poses, RigProblem* problem);

}  // namespace heba
