// The sigmas beyond which the data say nothing about a camera's pose.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "heba/base/error.h"
#include "heba/data/pair_solution.h"

namespace heba {

// The pose of a camera on its mount: its block of the unknowns, and the distance at which the camera works.
struct CameraReach {
  std::string block;
  double distance_m = 0;
};

// Returns a Failure if the sigma of a camera's position exceeds its working distance, or if that of its orientation
// exceeds 30 deg. A smaller sigma is a result, however large: whoever reads it judges it.
std::optional<Failure> CheckDetermined(const Covariance& covariance, const std::vector<CameraReach>& cameras);

}  // namespace heba
