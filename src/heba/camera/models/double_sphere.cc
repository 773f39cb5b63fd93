// The model of Usenko, Demmel and Cremers 2018 ("The Double Sphere Camera Model"), Kalibr's ds. With
//   d1 = |(x, y, z)|,  w = xi d1 + z,  d2 = |(x, y, w)|,  D = alpha d2 + (1 - alpha) w,  x' = x / D,  y' = y / D
// If xi = alpha = 0, it is the pinhole model; if xi = 0, it is the unified model.
#include "heba/camera/batched_camera_model.h"
#include "heba/camera/sphere_projection.h"

namespace heba {
namespace {

struct DoubleSphere : PinholeIfAllAreZero<2> {
  static constexpr int kNumDistortion = 2;
  static CameraModelFacts Facts() {
    CameraModelFacts facts;
    facts.kind = LensKind::kFisheye;
    facts.distortion_names = {"xi", "alpha"};
    // A lens with xi = -0.17 is also imitated, with residuals of a few hundredths of a pixel, by one with xi = 0.22;
    // the residuals of the lenses between them are ten times larger.
    facts.initial_distortions = {{-0.25, 0.55}, {0.25, 0.65}};
    facts.kalibr = {"ds", "none", 2};
    facts.examples = {{"stereographic", {450, 459, 652.3, 470.9, 0, 0.5}},
                      // The corners are 106 deg from the optical axis.
                      {"wide", {360, 367.2, 652.3, 470.9, -0.17, 0.59}},
                      {"narrow", {900, 918, 652.3, 470.9, 0.15, 0.3}}};
    return facts;
  }

  template <class V>
  HEBA_INLINE static void Distort(const double* distortion, const V& x, const V& y, const V& z,
                                  DistortedImage<V, kNumDistortion>* image) {
    const double xi = distortion[0];
    const double alpha = distortion[1];
    // Points behind this cone have no image.
    const double w1 = LargestCosine(alpha);
    const double least_cosine = -(w1 + xi) / std::sqrt(2 * w1 * xi + xi * xi + 1);
    const V rho2 = x * x + y * y;
    const V d1 = RootOf<V>(rho2 + z * z);
    const V w = xi * d1 + z;
    const V d2 = RootOf<V>(rho2 + w * w);
    const V inverse_d1 = 1.0 / d1;
    const V inverse_d2 = 1.0 / d2;
    // d2 depends on z, and on x and y beyond rho2, by w.
    const V by_w = alpha * w * inverse_d2 + (1 - alpha);
    ProjectionDivisor<V> divisor;
    divisor.value = alpha * d2 + (1 - alpha) * w;
    divisor.by_rho = alpha * inverse_d2 + by_w * xi * inverse_d1;
    divisor.by_z = by_w * (xi * z * inverse_d1 + 1.0);
    ProjectBy<V>(divisor, z > least_cosine * d1, x, y, image);
    SetByCoefficient<V>(by_w * d1, 0, image);
    SetByCoefficient<V>(d2 - w, 1, image);
  }
  // Computes the exact ray.
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    const double xi = params[4];
    const double alpha = params[5];
    const Eigen::Vector2d m((pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1]);
    const double r2 = m.squaredNorm();
    const double mz = (1 - alpha * alpha * r2) / (alpha * std::sqrt(1 - (2 * alpha - 1) * r2) + 1 - alpha);
    const double length = (mz * xi + std::sqrt(mz * mz + (1 - xi * xi) * r2)) / (mz * mz + r2);
    return {length * m.x(), length * m.y(), length * mz - xi};
  }
};

}  // namespace

const CameraModel& CameraModel_double_sphere() {
  static const BatchedCameraModel<DoubleSphere> model("double_sphere");
  return model;
}

}  // namespace heba
