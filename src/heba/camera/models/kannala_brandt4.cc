// Kannala and Brandt 2006 with four coefficients, as OpenCV's fisheye module and ROS (equidistant) write it. With
// theta the angle between the ray and the optical axis and phi its azimuth:
//   r = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8),  u = fx r cos(phi) + cx,  v = fy r sin(phi) + cy
// The projection goes on behind the image plane; only the ray straight back has no image.
#include "heba/camera/jet_camera_model.h"

#include <algorithm>

namespace heba {
namespace {

struct KannalaBrandt4 {
  static constexpr int kNumParams = 8;
  static std::vector<std::string> ParamNames() { return {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"}; }

  template <class T>
  static bool Project(const T* params, const T& x, const T& y, const T& z, T* u, T* v) {
    using std::atan2;
    using std::sqrt;
    const T rho2 = x * x + y * y;
    // r / rho, where rho is the distance from the optical axis.
    T scale;
    if (rho2 <= z * z * T(1e-16)) {
      if (!(z > T(0))) return false;
      scale = T(1) / z;
    } else {
      const T rho = sqrt(rho2);
      const T theta = atan2(rho, z);
      const T theta2 = theta * theta;
      scale = theta / rho *
              (T(1) + theta2 * (params[4] + theta2 * (params[5] + theta2 * (params[6] + theta2 * params[7]))));
    }
    *u = params[0] * (x * scale) + params[2];
    *v = params[1] * (y * scale) + params[3];
    return true;
  }
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d m((pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1]);
    const double r = m.norm();
    if (r < 1e-12) return Eigen::Vector3d::UnitZ();
    const double theta = std::min(r, 3.0);
    return {m.x() / r * std::sin(theta), m.y() / r * std::sin(theta), std::cos(theta)};
  }
};

}  // namespace

const CameraModel& CameraModel_kannala_brandt4() {
  static const JetCameraModel<KannalaBrandt4> model("kannala_brandt4");
  return model;
}

}  // namespace heba
