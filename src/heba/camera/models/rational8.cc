// OpenCV's rational model, ROS rational_polynomial: as brown5, with the radial factor
//   (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
#include "heba/camera/jet_camera_model.h"

namespace heba {
namespace {

struct Rational8 {
  static constexpr int kNumParams = 12;
  static std::vector<std::string> ParamNames() {
    return {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  }

  template <class T>
  static bool Project(const T* params, const T& x, const T& y, const T& z, T* u, T* v) {
    if (!(z > T(0))) return false;
    const T& p1 = params[6];
    const T& p2 = params[7];
    const T a = x / z;
    const T b = y / z;
    const T r2 = a * a + b * b;
    const T numerator = T(1) + r2 * (params[4] + r2 * (params[5] + r2 * params[8]));
    const T denominator = T(1) + r2 * (params[9] + r2 * (params[10] + r2 * params[11]));
    // Beyond a pole of the radial factor there is no image.
    if (!(denominator > T(0))) return false;
    const T radial = numerator / denominator;
    *u = params[0] * (a * radial + T(2) * p1 * a * b + p2 * (r2 + T(2) * a * a)) + params[2];
    *v = params[1] * (b * radial + p1 * (r2 + T(2) * b * b) + T(2) * p2 * a * b) + params[3];
    return true;
  }
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    return {(pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1], 1.0};
  }
};

}  // namespace

const CameraModel& CameraModel_rational8() {
  static const JetCameraModel<Rational8> model("rational8");
  return model;
}

}  // namespace heba
