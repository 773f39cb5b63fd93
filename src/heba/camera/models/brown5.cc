// The model of Brown 1966 in the notation of OpenCV and ROS (plumb_bob). If x, y = X / Z, Y / Z and r^2 = x^2 + y^2,
//   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
//   y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
#include "heba/camera/opencv_lens.h"
#include "heba/camera/radial_tangential.h"

namespace heba {
namespace {

struct Brown5 : OpenCvPolynomial<5> {
  static constexpr int kNumDistortion = 5;
  static CameraModelFacts Facts() {
    CameraModelFacts facts;
    facts.distortion_names = {"k1", "k2", "p1", "p2", "k3"};
    facts.examples = {{"undistorted", {1000, 1020, 652.3, 470.9, 0, 0, 0, 0, 0}},
                      {"typical", {1100, 1122, 652.3, 470.9, -0.12, 0.08, 0.0007, -0.0005, -0.01}},
                      // The corners, at 0.85 focal lengths without distortion, move inwards by 17 %.
                      {"barrel", {940, 958.8, 652.3, 470.9, -0.28, 0.09, 0.002, -0.001, -0.01}},
                      // The corners move outwards by a third.
                      {"pincushion", {800, 816, 652.3, 470.9, 0.35, 0.1, -0.001, 0.002, 0.01}}};
    return facts;
  }

  template <class V>
  HEBA_INLINE static void Distort(const double* distortion, const V& x, const V& y, const V& z,
                                  DistortedImage<V, kNumDistortion>* image) {
    const double k1 = distortion[0];
    const double k2 = distortion[1];
    const double k3 = distortion[4];
    const auto ray = PlaneImageOf<V>(x, y, z);
    const V r2 = ray.r2;
    const V radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const V radial_by_r2 = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3));
    DistortRadialTangential<V>(ray, radial, radial_by_r2, distortion[2], distortion[3], image);
    const V r4 = r2 * r2;
    SetByRadial<V>(ray, r2, 0, image);
    SetByRadial<V>(ray, r4, 1, image);
    SetByRadial<V>(ray, r4 * r2, 4, image);
  }
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    return {(pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1], 1.0};
  }
};

}  // namespace

const CameraModel& CameraModel_brown5() {
  static const BatchedCameraModel<Brown5> model("brown5");
  return model;
}

}  // namespace heba
