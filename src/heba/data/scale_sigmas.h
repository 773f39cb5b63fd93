// The sigmas of scales say what is known about lengths. Images and the poses of a robot tell the ratio of the scale of
// a target to that of the robot, and nothing else: the scale of the result is known as well as one of the two.
#pragma once

#include <algorithm>
#include <vector>

namespace heba {

// One sigma of a scale about 1, as a ratio, if nothing is stated: that of a board whose origin is not known, of a sheet
// that was printed true to scale, of a robot's lengths, and of the lengths of a robot that was calibrated.
inline constexpr double kTargetScaleSigma = 0.01;
inline constexpr double kSheetScaleSigma = 0.002;
inline constexpr double kRobotScaleSigma = 0.001;
inline constexpr double kCalibratedRobotScaleSigma = 0.0003;

// Returns the sigma with which a scale is a measurement: an exact one has no weight that is finite.
inline double AsMeasured(double scale_sigma) {
  constexpr double kLeast = 1e-6;
  return std::max(scale_sigma, kLeast);
}

// The scales of a problem; 0 stands for one that is exact.
struct ScaleSigmas {
  std::vector<double> targets;  // One per target: one sigma of either of its scales.
  std::vector<double> robots;   // One per arm.
};

}  // namespace heba
