// Numbers and poses in the data of pages, rounded to limit the size of the page.
#pragma once

#include <cmath>

#include <nlohmann/json.hpp>

#include "heba/geometry/rigid3.h"

namespace heba {

// Rounds to `digits` decimals.
inline double Rounded(double value, int digits) {
  const double power = std::pow(10.0, digits);
  return std::round(value * power) / power;
}

// Returns a pose as {"t": [x, y, z] in m, "q": [x, y, z, w]}.
inline nlohmann::ordered_json PagePose(const Rigid3d& pose) {
  const Eigen::Vector3d& t = pose.translation;
  const Eigen::Vector4d& q = pose.rotation.coeffs();
  return {{"t", {Rounded(t.x(), 6), Rounded(t.y(), 6), Rounded(t.z(), 6)}},
          {"q", {Rounded(q[0], 7), Rounded(q[1], 7), Rounded(q[2], 7), Rounded(q[3], 7)}}};
}

}  // namespace heba
