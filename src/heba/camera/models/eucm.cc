// The enhanced unified model of Khomutenko, Garcia and Martinet 2016 ("An Enhanced Unified Camera Model"), Kalibr's
// eucm. With
//   d = sqrt(beta (x^2 + y^2) + z^2),  D = alpha d + (1 - alpha) z,  x' = x / D,  y' = y / D
// If alpha = 0, it is the pinhole model.
#include "heba/camera/batched_camera_model.h"
#include "heba/camera/sphere_projection.h"

namespace heba {
namespace {

struct Eucm {
  static constexpr int kNumDistortion = 2;
  static CameraModelFacts Facts() {
    CameraModelFacts facts;
    facts.kind = LensKind::kFisheye;
    facts.distortion_names = {"alpha", "beta"};
    facts.initial_distortions = {{0.5, 1.0}};  // The stereographic projection.
    facts.kalibr = {"eucm", "none", 2};
    facts.examples = {{"stereographic", {450, 459, 652.3, 470.9, 0.5, 1}},
                      {"wide", {380, 387.6, 652.3, 470.9, 0.58, 1.1}},
                      {"narrow", {900, 918, 652.3, 470.9, 0.3, 0.7}}};
    return facts;
  }
  static std::optional<OpenCvLens> ToOpenCv(const std::vector<double>& distortion) {
    return distortion[0] == 0 ? std::optional<OpenCvLens>(OpenCvLens()) : std::nullopt;
  }
  static std::optional<std::vector<double>> FromOpenCv(const OpenCvLens& lens) {
    if (!OpenCvPolynomial<0>::FromOpenCv(lens)) return std::nullopt;
    return std::vector<double>{0.0, 1.0};
  }

  template <class V>
  HEBA_INLINE static void Distort(const double* distortion, const V& x, const V& y, const V& z,
                                  DistortedImage<V, kNumDistortion>* image) {
    const double alpha = distortion[0];
    const double beta = distortion[1];
    const V rho2 = x * x + y * y;
    const V d = RootOf<V>(beta * rho2 + z * z);
    const V inverse_d = 1.0 / d;
    ProjectionDivisor<V> divisor;
    divisor.value = alpha * d + (1 - alpha) * z;
    divisor.by_rho = alpha * beta * inverse_d;
    divisor.by_z = alpha * z * inverse_d + (1 - alpha);
    // The model has no meaning unless beta is positive.
    const double least = beta > 0 ? -LargestCosine(alpha) : std::numeric_limits<double>::quiet_NaN();
    ProjectBy<V>(divisor, z > least * d, x, y, image);
    SetByCoefficient<V>(d - z, 0, image);
    SetByCoefficient<V>(0.5 * alpha * rho2 * inverse_d, 1, image);
  }
  // Computes the exact ray.
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    const double alpha = params[4];
    const double beta = params[5];
    const Eigen::Vector2d m((pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1]);
    const double r2 = m.squaredNorm();
    const double root = std::sqrt(1 - (2 * alpha - 1) * beta * r2);
    return {m.x(), m.y(), (1 - beta * alpha * alpha * r2) / (alpha * root + 1 - alpha)};
  }
};

}  // namespace

const CameraModel& CameraModel_eucm() {
  static const BatchedCameraModel<Eucm> model("eucm");
  return model;
}

}  // namespace heba
