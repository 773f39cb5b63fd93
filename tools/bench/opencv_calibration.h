// The same with OpenCV, to compare with: as its users call it.
#pragma once

#include <string>

#include "heba/data/problem.h"
#include "heba/evaluation/metrics.h"

namespace heba {

// Camera and poses of the views' boards (cv::calibrateCamera).
Camera CalibrateCameraWithOpenCv(const Problem& problem);

// camera_mount_from_camera (cv::calibrateHandEye, cv::calibrateRobotWorldHandEye). `method`: tsai, park, horaud,
// andreff, daniilidis, shah or li.
Rigid3d SolveHandEyeWithOpenCv(const std::string& method, const std::vector<PosePair>& pairs);

}  // namespace heba
