// OpenCV's rational model (rational_polynomial in ROS): brown5 with the radial factor
//   (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
#include "heba/camera/opencv_lens.h"
#include "heba/camera/radial_tangential.h"

namespace heba {
namespace {

struct Rational8 : OpenCvPolynomial<8> {
  static constexpr int kNumDistortion = 8;
  static CameraModelFacts Facts() {
    CameraModelFacts facts;
    facts.distortion_names = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
    facts.examples = {
        {"undistorted", {1000, 1020, 652.3, 470.9, 0, 0, 0, 0, 0, 0, 0, 0}},
        {"typical", {1100, 1122, 652.3, 470.9, -0.12, 0.08, 0.0007, -0.0005, -0.01, 0.0001, 0.0001, 0.0001}},
        // The corners, at 0.85 focal lengths without distortion, move inwards by 17 %.
        {"barrel", {940, 958.8, 652.3, 470.9, -0.28, 0.09, 0.002, -0.001, -0.01, 0, 0, 0}},
        // The corners move outwards by a third.
        {"pincushion", {800, 816, 652.3, 470.9, 0.35, 0.1, -0.001, 0.002, 0.01, 0.0002, 0.0002, 0.0002}}};
    return facts;
  }

  template <class V>
  HEBA_INLINE static void Distort(const double* distortion, const V& x, const V& y, const V& z,
                                  DistortedImage<V, kNumDistortion>* image) {
    const double k1 = distortion[0];
    const double k2 = distortion[1];
    const double k3 = distortion[4];
    const double k4 = distortion[5];
    const double k5 = distortion[6];
    const double k6 = distortion[7];
    const auto ray = PlaneImageOf<V>(x, y, z);
    const V r2 = ray.r2;
    const V numerator = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    // Points beyond a pole of the radial factor have no image.
    const V inverse = ReciprocalOrNaN<V>(1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
    const V radial = numerator * inverse;
    const V numerator_by_r2 = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3));
    const V denominator_by_r2 = k4 + r2 * (2.0 * k5 + r2 * (3.0 * k6));
    DistortRadialTangential<V>(ray, radial, (numerator_by_r2 - radial * denominator_by_r2) * inverse, distortion[2],
                               distortion[3], image);
    const V r4 = r2 * r2;
    const V r6 = r4 * r2;
    SetByRadial<V>(ray, r2 * inverse, 0, image);
    SetByRadial<V>(ray, r4 * inverse, 1, image);
    SetByRadial<V>(ray, r6 * inverse, 4, image);
    const V by_denominator = -radial * inverse;
    SetByRadial<V>(ray, r2 * by_denominator, 5, image);
    SetByRadial<V>(ray, r4 * by_denominator, 6, image);
    SetByRadial<V>(ray, r6 * by_denominator, 7, image);
  }
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    return {(pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1], 1.0};
  }
};

}  // namespace

const CameraModel& CameraModel_rational8() {
  static const BatchedCameraModel<Rational8> model("rational8");
  return model;
}

}  // namespace heba
