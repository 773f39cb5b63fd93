// The model of Brown 1966 without the sixth-order term: brown5 with k3 = 0. If x, y = X / Z, Y / Z and r^2 = x^2 + y^2,
//   x' = x (1 + k1 r^2 + k2 r^4) + 2 p1 x y + p2 (r^2 + 2 x^2)
//   y' = y (1 + k1 r^2 + k2 r^4) + p1 (r^2 + 2 y^2) + 2 p2 x y
#include "heba/camera/opencv_lens.h"
#include "heba/camera/radial_tangential.h"

namespace heba {
namespace {

struct Brown4 : OpenCvPolynomial<4> {
  static constexpr int kNumDistortion = 4;
  static CameraModelFacts Facts() {
    CameraModelFacts facts;
    facts.distortion_names = {"k1", "k2", "p1", "p2"};
    facts.kalibr = {"pinhole", "radtan"};
    facts.examples = {{"undistorted", {1000, 1020, 652.3, 470.9, 0, 0, 0, 0}},
                      {"typical", {1100, 1122, 652.3, 470.9, -0.12, 0.08, 0.0007, -0.0005}},
                      // The corners, at 0.85 focal lengths without distortion, move inwards by 17 %.
                      {"barrel", {940, 958.8, 652.3, 470.9, -0.28, 0.09, 0.002, -0.001}},
                      // The corners move outwards by a third.
                      {"pincushion", {800, 816, 652.3, 470.9, 0.35, 0.1, -0.001, 0.002}}};
    return facts;
  }

  template <class V>
  HEBA_INLINE static void Distort(const double* distortion, const V& x, const V& y, const V& z,
                                  DistortedImage<V, kNumDistortion>* image) {
    const double k1 = distortion[0];
    const double k2 = distortion[1];
    const auto ray = PlaneImageOf<V>(x, y, z);
    const V r2 = ray.r2;
    const V radial = 1.0 + r2 * (k1 + r2 * k2);
    const V radial_by_r2 = k1 + r2 * (2.0 * k2);
    DistortRadialTangential<V>(ray, radial, radial_by_r2, distortion[2], distortion[3], image);
    SetByRadial<V>(ray, r2, 0, image);
    SetByRadial<V>(ray, r2 * r2, 1, image);
  }
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    return {(pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1], 1.0};
  }
};

}  // namespace

const CameraModel& CameraModel_brown4() {
  static const BatchedCameraModel<Brown4> model("brown4");
  return model;
}

}  // namespace heba
