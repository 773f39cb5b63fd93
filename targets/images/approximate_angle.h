// Angles of limited accuracy.
#pragma once

#include <algorithm>
#include <cmath>

namespace heba {

// Returns the angle of (x, y), from the first axis towards the second, in turns, in [0, 1), to a thousandth of a
// turn.
inline double ApproximateAngle(double x, double y) {
  const double ax = std::abs(x);
  const double ay = std::abs(y);
  const double slope = std::min(ax, ay) / std::max({ax, ay, 1e-300});
  // The polynomial is a least-squares approximation of the arc tangent.
  double turn = slope * (0.97239411 - 0.19194795 * slope * slope) / 6.283185307179586;
  if (ay > ax) turn = 0.25 - turn;
  if (x < 0) turn = 0.5 - turn;
  if (y < 0) turn = 1 - turn;
  return turn < 1 ? turn : 0;
}

}  // namespace heba
