// The same computations with OpenCV, called as its users call it, for comparison.
#pragma once

#include <string>

#include "heba/data/pair_problem.h"
#include "heba/evaluation/metrics.h"

namespace heba {

// Returns the camera that cv::calibrateCamera estimates together with the board poses of the views.
Camera CalibrateCameraWithOpenCv(const PairProblem& problem);

// Returns camera_mount_from_camera as estimated by cv::calibrateHandEye or cv::calibrateRobotWorldHandEye. `method`
// is tsai, park, horaud, andreff, daniilidis, shah or li.
Rigid3d SolveHandEyeWithOpenCv(const std::string& method, const std::vector<PosePair>& pairs);

}  // namespace heba
