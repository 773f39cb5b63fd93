// u = fx x / z + cx, v = fy y / z + cy.
#include "heba/camera/jet_camera_model.h"

namespace heba {
namespace {

struct Pinhole {
  static constexpr int kNumParams = 4;
  static std::vector<std::string> ParamNames() { return {"fx", "fy", "cx", "cy"}; }

  template <class T>
  static bool Project(const T* params, const T& x, const T& y, const T& z, T* u, T* v) {
    if (!(z > T(0))) return false;
    *u = params[0] * (x / z) + params[2];
    *v = params[1] * (y / z) + params[3];
    return true;
  }
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    return {(pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1], 1.0};
  }
};

}  // namespace

const CameraModel& CameraModel_pinhole() {
  static const JetCameraModel<Pinhole> model("pinhole");
  return model;
}

}  // namespace heba
