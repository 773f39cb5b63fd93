// Formats the result of a run with a rig as tables for the terminal.
#pragma once

#include <string>

#include "heba/evaluation/rig_evaluation.h"
#include "tools/text/result_text.h"

namespace heba {

// Returns the verdict, a table of the cameras, the poses of cameras, targets and arms, and the poses between cameras,
// each with its uncertainty. At most 80 columns wide, except for long texts.
std::string RigTable(const RigResult& result, Colour colour);

// Returns the largest sigma of a pose along and about its axes: m and rad.
std::pair<double, double> LargestSigmas(const Eigen::Matrix<double, 6, 6>& covariance);
// Returns how many images of a camera were used, and how many there are.
std::pair<int, int> CountImages(const RigResult& result, const std::string& camera);

}  // namespace heba
