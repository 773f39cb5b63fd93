// A complete camera model, built from its distortion function, which is all that a file in camera/models defines. Every
// model has the form
//   u = fx x' + cx,  v = fy y' + cy
// The point (x', y') is the distorted image of the ray, a function of the ray and the distortion coefficients. The
// inverse is computed by Gauss-Newton steps on the sphere of rays.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "heba/base/error.h"
#include "heba/camera/camera_model.h"
#include "heba/kernels/simd.h"

namespace heba {

// The distorted image (x', y') of a point and its derivatives. V is double, or a vector of lanes.
template <class V, int kNumDistortion>
struct DistortedImage {
  V x;
  V y;
  V x_by_point[3];
  V y_by_point[3];
  V x_by_distortion[std::max(kNumDistortion, 1)];
  V y_by_distortion[std::max(kNumDistortion, 1)];
};

// Returns 1 / z if z is positive, NaN otherwise.
template <class V>
HEBA_INLINE V ReciprocalOrNaN(const V& z) {
  const V none = AllLanes<V>(std::numeric_limits<double>::quiet_NaN());
  return z > 0.0 ? 1.0 / z : none;
}

// The class `Lens` must define
//   static constexpr int kNumDistortion;
//   static CameraModelFacts Facts();
//   // See CameraModel::ToOpenCv and FromOpenCv; heba/camera/opencv_lens.h has those of the usual lenses.
//   static std::optional<OpenCvLens> ToOpenCv(const std::vector<double>& distortion);
//   static std::optional<std::vector<double>> FromOpenCv(const OpenCvLens& lens);
//   // HEBA_INLINE. If the point has no image, x or y is not finite.
//   template <class V> static void Distort(const double* distortion, const V& x, const V& y, const V& z,
//                                          DistortedImage<V, kNumDistortion>* image);
//   // Returns an initial guess for the ray of a pixel, of any length.
//   static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel);
template <class Lens>
class BatchedCameraModel final : public CameraModel {
 public:
  explicit BatchedCameraModel(std::string name)
      : name_(std::move(name)), facts_(Lens::Facts()), param_names_({"fx", "fy", "cx", "cy"}) {
    CHECK_EQ(facts_.distortion_names.size(), static_cast<size_t>(kNumDistortion));
    param_names_.insert(param_names_.end(), facts_.distortion_names.begin(), facts_.distortion_names.end());
  }
  std::string_view name() const override { return name_; }
  const CameraModelFacts& facts() const override { return facts_; }
  std::optional<OpenCvLens> ToOpenCv(const std::vector<double>& distortion) const override {
    CHECK_EQ(distortion.size(), static_cast<size_t>(kNumDistortion));
    return Lens::ToOpenCv(distortion);
  }
  std::optional<std::vector<double>> FromOpenCv(const OpenCvLens& lens) const override {
    return Lens::FromOpenCv(lens);
  }
  const std::vector<std::string>& param_names() const override { return param_names_; }

  bool ProjectBatch(const double* params, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                    bool with_derivatives, ProjectionBatch* batch) const override {
    // The rotation matrix row by row, then the translation.
    double pose[12];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) pose[3 * i + j] = rotation(i, j);
      pose[9 + i] = translation[i];
    }
    const Simd set = ActiveSimd();
    return with_derivatives ? SelectForIsa(set, &DifferentiateBaseline, &DifferentiateAvx2, &DifferentiateAvx512)(
                                  params, pose, batch)
                            : SelectForIsa(set, &ProjectBaseline, &ProjectAvx2, &ProjectAvx512)(params, pose, batch);
  }

  std::optional<Eigen::Vector3d> Unproject(const double* params, const Eigen::Vector2d& pixel) const override {
    Eigen::Vector3d ray = Lens::GuessRay(params, pixel);
    if (const std::optional<Eigen::Vector3d> easy = UnprojectOnPlane(params, ray, pixel)) return easy;
    if (!ray.allFinite() || ray.norm() < 1e-12) return std::nullopt;
    ray.normalize();
    // The initial guess may lie beyond the radius at which the distortion folds back; it is then moved towards the
    // axis.
    std::optional<Linearisation> here = Linearise(params, ray, pixel);
    for (int attempt = 0; attempt < 20 && !here; ++attempt) {
      ray = (ray + Eigen::Vector3d::UnitZ()).normalized();
      here = Linearise(params, ray, pixel);
    }
    if (!here) return std::nullopt;
    for (int iteration = 0; iteration < 60 && here->error_px.norm() >= kTolerancePx; ++iteration) {
      Eigen::Vector2d step = here->jacobian.inverse() * here->error_px;
      constexpr double kMaxStepRad = 0.3;
      if (step.norm() > kMaxStepRad) step *= kMaxStepRad / step.norm();
      // Halve the step until the error decreases.
      std::optional<Linearisation> next;
      for (int halving = 0; halving < 12 && !next; ++halving, step *= 0.5) {
        next = Linearise(params, (here->ray - here->basis * step).normalized(), pixel);
        if (next && next->error_px.norm() >= here->error_px.norm()) next.reset();
      }
      if (!next) break;
      here = next;
    }
    constexpr double kAcceptedPx = 1e-6;
    return here->error_px.norm() < kAcceptedPx ? std::optional<Eigen::Vector3d>(here->ray) : std::nullopt;
  }

 private:
  static constexpr int kNumDistortion = Lens::kNumDistortion;
  static_assert(kNumDistortion <= ProjectionBatch::kMaxDistortion);

  template <int kLanes, bool kWithDerivatives>
  HEBA_INLINE static bool Run(const double* params, const double* pose, ProjectionBatch* batch) {
    using V = Lanes<kLanes>;
    // This sum becomes NaN if any pixel is not finite.
    V check = AllLanes<V>(0);
    for (int i = 0; i < batch->size; i += kLanes) {
      const V px = LoadLanes<V>(batch->points[0] + i);
      const V py = LoadLanes<V>(batch->points[1] + i);
      const V pz = LoadLanes<V>(batch->points[2] + i);
      const V x = pose[0] * px + pose[1] * py + pose[2] * pz + pose[9];
      const V y = pose[3] * px + pose[4] * py + pose[5] * pz + pose[10];
      const V z = pose[6] * px + pose[7] * py + pose[8] * pz + pose[11];
      DistortedImage<V, kNumDistortion> image;
      Lens::template Distort<V>(params + 4, x, y, z, &image);
      const V u = params[0] * image.x + params[2];
      const V v = params[1] * image.y + params[3];
      check += (u - u) + (v - v);  // NOLINT(misc-redundant-expression): not 0 if not finite.
      StoreLanes(u, batch->pixels[0] + i);
      StoreLanes(v, batch->pixels[1] + i);
      if constexpr (kWithDerivatives) {
        StoreRows<V>(params[0], x, y, z, image.x, image.x_by_point, image.x_by_distortion, i, batch->rows[0]);
        StoreRows<V>(params[1], x, y, z, image.y, image.y_by_point, image.y_by_distortion, i, batch->rows[1]);
      }
    }
    return SumOfLanes(check) == 0;
  }

  // Writes the rows of one axis of ProjectionBatch::rows.
  template <class V>
  HEBA_INLINE static void StoreRows(double focal, const V& x, const V& y, const V& z, const V& image, const V* by_point,
                                    const V* by_distortion, int i, double (*rows)[ProjectionBatch::kCapacity]) {
    const V dx = focal * by_point[0];
    const V dy = focal * by_point[1];
    const V dz = focal * by_point[2];
    StoreLanes(dx, rows[0] + i);
    StoreLanes(dy, rows[1] + i);
    StoreLanes(dz, rows[2] + i);
    // d p / d w = -skew(p), so the row is p x (dx, dy, dz).
    StoreLanes<V>(y * dz - z * dy, rows[3] + i);
    StoreLanes<V>(z * dx - x * dz, rows[4] + i);
    StoreLanes<V>(x * dy - y * dx, rows[5] + i);
    StoreLanes(image, rows[6] + i);
    StoreLanes(AllLanes<V>(1), rows[7] + i);
    for (int k = 0; k < kNumDistortion; ++k) StoreLanes<V>(focal * by_distortion[k], rows[8 + k] + i);
  }

  static bool ProjectBaseline(const double* params, const double* pose, ProjectionBatch* batch) {
    return Run<kLanesOf<Simd::kBaseline>, false>(params, pose, batch);
  }
  static bool DifferentiateBaseline(const double* params, const double* pose, ProjectionBatch* batch) {
    return Run<kLanesOf<Simd::kBaseline>, true>(params, pose, batch);
  }
  HEBA_TARGET_AVX2 static bool ProjectAvx2(const double* params, const double* pose, ProjectionBatch* batch) {
    return Run<kLanesOf<Simd::kAvx2>, false>(params, pose, batch);
  }
  HEBA_TARGET_AVX2 static bool DifferentiateAvx2(const double* params, const double* pose, ProjectionBatch* batch) {
    return Run<kLanesOf<Simd::kAvx2>, true>(params, pose, batch);
  }
  HEBA_TARGET_AVX512 static bool ProjectAvx512(const double* params, const double* pose, ProjectionBatch* batch) {
    return Run<kLanesOf<Simd::kAvx512>, false>(params, pose, batch);
  }
  HEBA_TARGET_AVX512 static bool DifferentiateAvx512(const double* params, const double* pose, ProjectionBatch* batch) {
    return Run<kLanesOf<Simd::kAvx512>, true>(params, pose, batch);
  }

  // Far below the resolution of any detector; above the round-off at 1e5 px.
  static constexpr double kTolerancePx = 1e-9;

  // Unprojects by Newton's method in the plane z = 1. Returns nothing unless every step at least halves the error.
  static std::optional<Eigen::Vector3d> UnprojectOnPlane(const double* params, const Eigen::Vector3d& guess,
                                                         const Eigen::Vector2d& pixel) {
    constexpr double kLeastZ = 0.3;  // Smallest z of the unit ray.
    if (!(guess.z() > kLeastZ * guess.norm())) return std::nullopt;
    Eigen::Vector2d at = guess.head<2>() / guess.z();
    double last_px = std::numeric_limits<double>::infinity();
    constexpr int kMaxSteps = 10;
    for (int step = 0; step < kMaxSteps; ++step) {
      DistortedImage<double, kNumDistortion> image;
      Lens::template Distort<double>(params + 4, at.x(), at.y(), 1.0, &image);
      const Eigen::Vector2d error_px =
          Eigen::Vector2d(params[0] * image.x + params[2], params[1] * image.y + params[3]) - pixel;
      Eigen::Matrix2d jacobian;
      jacobian << params[0] * image.x_by_point[0], params[0] * image.x_by_point[1], params[1] * image.y_by_point[0],
          params[1] * image.y_by_point[1];
      const double determinant = jacobian.determinant();
      const double now_px = error_px.norm();
      if (!(determinant > 0) || !(now_px <= 0.5 * last_px)) return std::nullopt;
      if (now_px < kTolerancePx) return Eigen::Vector3d(at.x(), at.y(), 1).normalized();
      at -= jacobian.inverse() * error_px;
      last_px = now_px;
    }
    return std::nullopt;
  }

  // The projection, linearised at a ray: the ray moves along two directions at right angles to it.
  struct Linearisation {
    Eigen::Vector3d ray;
    Eigen::Matrix<double, 3, 2> basis;
    Eigen::Vector2d error_px;
    Eigen::Matrix2d jacobian;
  };
  // Returns nothing if the ray has no image or lies where the distortion folds back, since the image is mirrored there.
  static std::optional<Linearisation> Linearise(const double* params, const Eigen::Vector3d& ray,
                                                const Eigen::Vector2d& pixel) {
    Linearisation at;
    at.ray = ray;
    const Eigen::Vector3d helper = std::abs(ray.x()) < 0.7 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
    // The basis is right-handed about the ray, as u and v are about the optical axis.
    at.basis.col(0) = ray.cross(helper).normalized();
    at.basis.col(1) = ray.cross(at.basis.col(0));
    DistortedImage<double, kNumDistortion> image;
    Lens::template Distort<double>(params + 4, ray.x(), ray.y(), ray.z(), &image);
    at.error_px = Eigen::Vector2d(params[0] * image.x + params[2], params[1] * image.y + params[3]) - pixel;
    at.jacobian.row(0) = params[0] * Eigen::Map<const Eigen::RowVector3d>(image.x_by_point) * at.basis;
    at.jacobian.row(1) = params[1] * Eigen::Map<const Eigen::RowVector3d>(image.y_by_point) * at.basis;
    if (!at.error_px.allFinite() || !at.jacobian.allFinite() || at.jacobian.determinant() <= 0) return std::nullopt;
    return at;
  }

  std::string name_;
  CameraModelFacts facts_;
  std::vector<std::string> param_names_;
};

}  // namespace heba
