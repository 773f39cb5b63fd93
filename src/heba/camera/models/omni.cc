// The unified model with Brown's distortion of Mei and Rives 2007 ("Single View Point Omnidirectional Camera
// Calibration from Planar Grids"), Kalibr's omni with radtan. The point is projected to the unit sphere, and from a
// point xi behind its centre to the plane:
//   d = |(x, y, z)|,  D = z + xi d,  a = x / D,  b = y / D
// (x', y') is the image of (a, b) by brown4's k1 k2 p1 p2. If xi = 0, the model is brown4.
#include "heba/camera/radial_tangential.h"
#include "heba/camera/sphere_projection.h"

namespace heba {
namespace {

struct Omni {
  static constexpr int kNumDistortion = 5;
  static CameraModelFacts Facts() {
    CameraModelFacts facts;
    facts.kind = LensKind::kFisheye;
    facts.distortion_names = {"xi", "k1", "k2", "p1", "p2"};
    facts.initial_distortions = {{1.0, 0.0, 0.0, 0.0, 0.0}};  // The stereographic projection.
    facts.kalibr = {"omni", "radtan", 1};
    facts.examples = {{"stereographic", {900, 918, 652.3, 470.9, 1, 0, 0, 0, 0}},
                      {"wide", {800, 816, 652.3, 470.9, 1.2, -0.05, 0.01, 0.0007, -0.0005}},
                      {"narrow", {1100, 1122, 652.3, 470.9, 0.3, -0.12, 0.05, -0.0006, 0.0008}}};
    return facts;
  }
  static std::optional<OpenCvLens> ToOpenCv(const std::vector<double>& distortion) {
    if (distortion[0] != 0) return std::nullopt;
    return OpenCvLens{LensKind::kPerspective, {distortion.begin() + 1, distortion.end()}};
  }
  static std::optional<std::vector<double>> FromOpenCv(const OpenCvLens& lens) {
    std::optional<std::vector<double>> distortion = OpenCvPolynomial<4>::FromOpenCv(lens);
    if (distortion) distortion->insert(distortion->begin(), 0.0);
    return distortion;
  }

  template <class V>
  HEBA_INLINE static void Distort(const double* distortion, const V& x, const V& y, const V& z,
                                  DistortedImage<V, kNumDistortion>* image) {
    const double xi = distortion[0];
    const V d = RootOf<V>(x * x + y * y + z * z);
    const V inverse_d = 1.0 / d;
    ProjectionDivisor<V> divisor;
    divisor.value = z + xi * d;
    divisor.by_rho = xi * inverse_d;
    divisor.by_z = 1.0 + xi * z * inverse_d;
    // Beyond this angle, rays leave the sphere where the projection cannot see it (xi > 1) or hit no image.
    const double least_cosine = xi > 1 ? -1 / xi : -xi;
    DistortedImage<V, 1> plane;
    ProjectBy<V>(divisor, z > least_cosine * d, x, y, &plane);
    SetByCoefficient<V>(d, 0, &plane);
    // Brown's distortion, with its derivatives by a and b (a plane at depth 1).
    const V r2 = plane.x * plane.x + plane.y * plane.y;
    const PlaneImage<V> ray{plane.x, plane.y, r2, AllLanes<V>(1)};
    const double k1 = distortion[1];
    const double k2 = distortion[2];
    DistortedImage<V, 4> brown;
    DistortRadialTangential<V>(ray, 1.0 + r2 * (k1 + r2 * k2), k1 + r2 * (2.0 * k2), distortion[3], distortion[4],
                               &brown);
    SetByRadial<V>(ray, r2, 0, &brown);
    SetByRadial<V>(ray, r2 * r2, 1, &brown);
    image->x = brown.x;
    image->y = brown.y;
    for (int i = 0; i < 3; ++i) {
      image->x_by_point[i] = brown.x_by_point[0] * plane.x_by_point[i] + brown.x_by_point[1] * plane.y_by_point[i];
      image->y_by_point[i] = brown.y_by_point[0] * plane.x_by_point[i] + brown.y_by_point[1] * plane.y_by_point[i];
    }
    image->x_by_distortion[0] =
        brown.x_by_point[0] * plane.x_by_distortion[0] + brown.x_by_point[1] * plane.y_by_distortion[0];
    image->y_by_distortion[0] =
        brown.y_by_point[0] * plane.x_by_distortion[0] + brown.y_by_point[1] * plane.y_by_distortion[0];
    for (int k = 0; k < 4; ++k) {
      image->x_by_distortion[1 + k] = brown.x_by_distortion[k];
      image->y_by_distortion[1 + k] = brown.y_by_distortion[k];
    }
  }
  // Computes the ray without Brown's distortion; the nearest one if the pixel is outside the image of all rays.
  static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel) {
    const double xi = params[4];
    Eigen::Vector2d m((pixel.x() - params[2]) / params[0], (pixel.y() - params[3]) / params[1]);
    constexpr double kWithin = 0.95;  // Relative to the radius of the image.
    const double largest = xi > 1 ? kWithin / std::sqrt(xi * xi - 1) : std::numeric_limits<double>::infinity();
    if (m.norm() > largest) m *= largest / m.norm();
    const double r2 = m.squaredNorm();
    const double length = (xi + std::sqrt(1 + (1 - xi * xi) * r2)) / (r2 + 1);
    return {length * m.x(), length * m.y(), length - xi};
  }
};

}  // namespace

const CameraModel& CameraModel_omni() {
  static const BatchedCameraModel<Omni> model("omni");
  return model;
}

}  // namespace heba
