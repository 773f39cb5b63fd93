#include "tests/support/imaged_disc.h"

#include <cmath>

#include "heba/base/units.h"

namespace heba {

Eigen::Vector2d ImagedCentroid(const Camera& camera, const Rigid3d& camera_from_target,
                               const Eigen::Vector3d& centre_in_target, double radius_m) {
  constexpr int kNumSides = 1024;
  const Eigen::Vector2d middle_px = ProjectPoint(camera, camera_from_target * centre_in_target).value();
  double twice_area_px2 = 0;
  Eigen::Vector2d moment_px3 = Eigen::Vector2d::Zero();
  Eigen::Vector2d from_px;
  for (int k = 0; k <= kNumSides; ++k) {
    const double angle_rad = 2 * kPi * k / kNumSides;
    const Eigen::Vector3d rim =
        centre_in_target + radius_m * Eigen::Vector3d(std::cos(angle_rad), std::sin(angle_rad), 0);
    const Eigen::Vector2d to_px = ProjectPoint(camera, camera_from_target * rim).value() - middle_px;
    if (k > 0) {
      const double cross_px2 = from_px.x() * to_px.y() - from_px.y() * to_px.x();
      twice_area_px2 += cross_px2;
      moment_px3 += cross_px2 / 3 * (from_px + to_px);
    }
    from_px = to_px;
  }
  return middle_px + moment_px3 / twice_area_px2;
}

}  // namespace heba
