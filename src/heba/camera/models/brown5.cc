// Brown 1966 as OpenCV and ROS (plumb_bob) write it. With x, y = X / Z, Y / Z and r^2 = x^2 + y^2:
//   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
//   y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
#include "heba/camera/jet_camera_model.h"

namespace heba {
namespace {

struct Brown5 {
  static constexpr int kNumParams = 9;
  static std::vector<std::string> ParamNames() { return {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"}; }

  template <class T>
  static bool Project(const T* params, const T& x, const T& y, const T& z, T* u, T* v) {
    if (!(z > T(0))) return false;
    const T& k1 = params[4];
    const T& k2 = params[5];
    const T& p1 = params[6];
    const T& p2 = params[7];
    const T& k3 = params[8];
    const T a = x / z;
    const T b = y / z;
    const T r2 = a * a + b * b;
    const T radial = T(1) + r2 * (k1 + r2 * (k2 + r2 * k3));
    *u = params[0] * (a * radial + T(2) * p1 * a * b + p2 * (r2 + T(2) * a * a)) + params[2];
    *v = params[1] * (b * radial + p1 * (r2 + T(2) * b * b) + T(2) * p2 * a * b) + params[3];
    return true;
  }
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    return {(pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1], 1.0};
  }
};

}  // namespace

const CameraModel& CameraModel_brown5() {
  static const JetCameraModel<Brown5> model("brown5");
  return model;
}

}  // namespace heba
