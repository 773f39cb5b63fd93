// A whole camera model from one templated function: what a file in camera/models writes. The Jacobians come from
// Ceres' Jets and the inverse from Gauss-Newton steps on the sphere of rays, until a model brings its own.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include <ceres/jet.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "heba/camera/camera_model.h"

namespace heba {

// `Projection` has
//   static constexpr int kNumParams;
//   static std::vector<std::string> ParamNames();
//   // False if the point has no image.
//   template <class T> static bool Project(const T* params, const T& x, const T& y, const T& z, T* u, T* v);
//   // A first guess of the ray of a pixel, of any length.
//   static Eigen::Vector3d GuessRay(const double* params, const Eigen::Vector2d& pixel);
template <class Projection>
class JetCameraModel final : public CameraModel {
 public:
  explicit JetCameraModel(std::string name) : name_(std::move(name)), param_names_(Projection::ParamNames()) {}
  std::string_view name() const override { return name_; }
  const std::vector<std::string>& param_names() const override { return param_names_; }

  bool Project(const double* params, const Points3& points_in_camera, Points2* pixels,
               ProjectionJacobian* jacobian) const override {
    const Eigen::Index n = points_in_camera.cols();
    pixels->resize(2, n);
    if (jacobian != nullptr) {
      jacobian->u.resize(kNumInputs, n);
      jacobian->v.resize(kNumInputs, n);
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      const double x = points_in_camera(0, i);
      const double y = points_in_camera(1, i);
      const double z = points_in_camera(2, i);
      if (jacobian == nullptr) {
        double u = 0;
        double v = 0;
        if (!Projection::Project(params, x, y, z, &u, &v) || !std::isfinite(u) || !std::isfinite(v)) return false;
        (*pixels)(0, i) = u;
        (*pixels)(1, i) = v;
        continue;
      }
      using Jet = ceres::Jet<double, kNumInputs>;
      Jet jet_params[Projection::kNumParams];
      for (int j = 0; j < Projection::kNumParams; ++j) jet_params[j] = Jet(params[j], 3 + j);
      Jet u;
      Jet v;
      if (!Projection::Project(jet_params, Jet(x, 0), Jet(y, 1), Jet(z, 2), &u, &v)) return false;
      if (!std::isfinite(u.a) || !std::isfinite(v.a)) return false;
      (*pixels)(0, i) = u.a;
      (*pixels)(1, i) = v.a;
      jacobian->u.col(i) = u.v;
      jacobian->v.col(i) = v.v;
    }
    return true;
  }

  std::optional<Eigen::Vector3d> Unproject(const double* params, const Eigen::Vector2d& pixel) const override {
    Eigen::Vector3d ray = Projection::GuessRay(params, pixel);
    if (!ray.allFinite() || ray.norm() < 1e-12) return std::nullopt;
    ray.normalize();
    // A guess from beyond the radius at which the distortion folds back is drawn towards the axis.
    std::optional<Linearisation> here = Linearise(params, ray, pixel);
    for (int attempt = 0; attempt < 20 && !here; ++attempt) {
      ray = (ray + Eigen::Vector3d::UnitZ()).normalized();
      here = Linearise(params, ray, pixel);
    }
    if (!here) return std::nullopt;
    constexpr double kTolerancePx = 1e-9;  // Far below what any detector resolves; above round-off at 1e5 px.
    for (int iteration = 0; iteration < 60 && here->error_px.norm() >= kTolerancePx; ++iteration) {
      Eigen::Vector2d step = here->jacobian.inverse() * here->error_px;
      constexpr double kMaxStepRad = 0.3;
      if (step.norm() > kMaxStepRad) step *= kMaxStepRad / step.norm();
      // Halve the step until it helps.
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
  static constexpr int kNumInputs = 3 + Projection::kNumParams;

  // The image about a ray: of the ray moved along two directions at right angles to it.
  struct Linearisation {
    Eigen::Vector3d ray;
    Eigen::Matrix<double, 3, 2> basis;
    Eigen::Vector2d error_px;
    Eigen::Matrix2d jacobian;
  };
  // Nothing if the ray has no image, or lies where the distortion folds back: there the image is turned over.
  static std::optional<Linearisation> Linearise(const double* params, const Eigen::Vector3d& ray,
                                                const Eigen::Vector2d& pixel) {
    Linearisation at;
    at.ray = ray;
    const Eigen::Vector3d helper = std::abs(ray.x()) < 0.7 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
    // Right-handed about the ray, as u and v are about the optical axis.
    at.basis.col(0) = ray.cross(helper).normalized();
    at.basis.col(1) = ray.cross(at.basis.col(0));
    using Jet = ceres::Jet<double, 2>;
    Jet jet_params[Projection::kNumParams];
    for (int j = 0; j < Projection::kNumParams; ++j) jet_params[j] = Jet(params[j]);
    Jet p[3];
    for (int j = 0; j < 3; ++j) {
      p[j].a = ray[j];
      p[j].v = at.basis.row(j).transpose();
    }
    Jet u;
    Jet v;
    if (!Projection::Project(jet_params, p[0], p[1], p[2], &u, &v)) return std::nullopt;
    at.error_px = Eigen::Vector2d(u.a, v.a) - pixel;
    at.jacobian.row(0) = u.v.transpose();
    at.jacobian.row(1) = v.v.transpose();
    if (!at.error_px.allFinite() || !at.jacobian.allFinite() || at.jacobian.determinant() <= 0) return std::nullopt;
    return at;
  }

  std::string name_;
  std::vector<std::string> param_names_;
};

}  // namespace heba
