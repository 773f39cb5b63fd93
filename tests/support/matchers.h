// gmock matchers for heba's types, with separate absolute tolerances for rotation and translation.
#pragma once

#include <ostream>

#include <gmock/gmock.h>

#include "heba/base/units.h"
#include "heba/geometry/rigid3.h"

namespace heba {

// Prints a pose in the messages of failed tests.
inline void PrintTo(const Rigid3d& pose, std::ostream* stream) {
  *stream << "Rigid3d(rotation_xyzw=[" << pose.rotation.coeffs().transpose() << "], translation=["
          << pose.translation.transpose() << "])";
}

MATCHER_P3(IsNearPose, expected, max_angle_rad, max_distance_m, "") {
  const double angle_rad = AngleRad(arg, expected);
  const double distance_m = DistanceM(arg, expected);
  *result_listener << "which is " << angle_rad << " rad and " << distance_m << " m away";
  return angle_rad <= max_angle_rad && distance_m <= max_distance_m;
}

}  // namespace heba
