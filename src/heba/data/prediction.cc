#include "heba/data/prediction.h"

#include <array>
#include <cmath>
#include <numbers>

namespace heba {
namespace {

constexpr int kOutline = 8;  // Points on a disc's outline.
using OutlineVector = Eigen::Matrix<double, 1, kOutline>;

// Derivatives of the trigonometric polynomial through equally spaced samples of one period, at the samples
// (Trefethen 2000, Spectral Methods in MATLAB, chapter 3): antisymmetric.
Eigen::Matrix<double, kOutline, kOutline> DerivativeMatrix() {
  Eigen::Matrix<double, kOutline, kOutline> matrix;
  for (int i = 0; i < kOutline; ++i) {
    for (int j = 0; j < kOutline; ++j) {
      const double sign = (i - j) % 2 == 0 ? 1 : -1;
      matrix(i, j) = i == j ? 0 : 0.5 * sign / std::tan(std::numbers::pi * (i - j) / kOutline);
    }
  }
  return matrix;
}

Eigen::Matrix<double, 2, kOutline> UnitCircle() {
  Eigen::Matrix<double, 2, kOutline> circle;
  for (int k = 0; k < kOutline; ++k) {
    const double angle = 2 * std::numbers::pi * k / kOutline;
    circle.col(k) << std::cos(angle), std::sin(angle);
  }
  return circle;
}

// The centroid of the area inside of an outline, and its derivatives by the outline's points.
struct Centroid {
  Eigen::Vector2d at;
  Eigen::Matrix<double, 2, kOutline> by_u;
  Eigen::Matrix<double, 2, kOutline> by_v;
};
Centroid CentroidOf(const OutlineVector& u, const OutlineVector& v, bool with_derivatives) {
  static const Eigen::Matrix<double, kOutline, kOutline> kDerivative = DerivativeMatrix().transpose();
  const double u0 = u.mean();
  const double v0 = v.mean();
  const OutlineVector x = u.array() - u0;
  const OutlineVector y = v.array() - v0;
  const OutlineVector dx = x * kDerivative;
  const OutlineVector dy = y * kDerivative;
  // Integrals over the angle, all by the same factor. area = 1/2 (x dy - y dx), moments 1/2 x^2 dy and -1/2 y^2 dx.
  const double area = 0.5 * (x.dot(dy) - y.dot(dx));
  const OutlineVector xx = x.cwiseProduct(x);
  const OutlineVector yy = y.cwiseProduct(y);
  const double moment_x = 0.5 * xx.dot(dy);
  const double moment_y = -0.5 * yy.dot(dx);
  Centroid centroid;
  const double cx = moment_x / area;
  const double cy = moment_y / area;
  centroid.at = {u0 + cx, v0 + cy};
  if (!with_derivatives) return centroid;
  // By parts, with the antisymmetry of the derivative: d area = dy du - dx dv, and so on. A shift of the whole outline
  // moves the centroid alike, so that the mean's part follows from the others.
  const OutlineVector dxx = xx * kDerivative;
  const OutlineVector dyy = yy * kDerivative;
  const auto with_mean = [](OutlineVector by, double total) -> OutlineVector {
    return by.array() + (total - by.sum()) / kOutline;
  };
  centroid.by_u.row(0) = with_mean((x.cwiseProduct(dy) - cx * dy) / area, 1);
  centroid.by_v.row(0) = with_mean((-0.5 * dxx + cx * dx) / area, 0);
  centroid.by_u.row(1) = with_mean((0.5 * dyy - cy * dy) / area, 0);
  centroid.by_v.row(1) = with_mean((-y.cwiseProduct(dx) + cy * dx) / area, 1);
  return centroid;
}

// d projection / d (left perturbation, camera parameters) of point i, from d projection / d (point, parameters).
void AddToPoseColumn(const ProjectionJacobian::Rows& by_point, Eigen::Index i, const Points3& points, double weight,
                     Eigen::Ref<Eigen::VectorXd> column) {
  const double dx = by_point(0, i);
  const double dy = by_point(1, i);
  const double dz = by_point(2, i);
  const double x = points(0, i);
  const double y = points(1, i);
  const double z = points(2, i);
  column[0] += weight * dx;
  column[1] += weight * dy;
  column[2] += weight * dz;
  // d p / d w = -skew(p), so the row is p x (dx, dy, dz).
  column[3] += weight * (y * dz - z * dy);
  column[4] += weight * (z * dx - x * dz);
  column[5] += weight * (x * dy - y * dx);
  column.tail(column.size() - 6) += weight * by_point.col(i).tail(by_point.rows() - 3);
}

}  // namespace

bool Predict(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
             const Observations& observations, Points2* pixels, ProjectionJacobian* jacobian) {
  static const Eigen::Matrix<double, 2, kOutline> kCircle = UnitCircle();
  const Eigen::Index n = observations.size();
  // Where the projected points of an observation begin: one of a point, kOutline of a disc.
  std::vector<Eigen::Index> begin(static_cast<size_t>(n) + 1, 0);
  for (Eigen::Index i = 0; i < n; ++i) {
    begin[static_cast<size_t>(i) + 1] = begin[static_cast<size_t>(i)] + (observations.RadiusM(i) > 0 ? kOutline : 1);
  }
  Points3 in_target(3, begin.back());
  for (Eigen::Index i = 0; i < n; ++i) {
    const double radius_m = observations.RadiusM(i);
    const Eigen::Index first = begin[static_cast<size_t>(i)];
    if (radius_m > 0) {
      in_target.middleCols<kOutline>(first).colwise() = observations.points_in_target.col(i);
      in_target.block<2, kOutline>(0, first) += radius_m * kCircle;
    } else {
      in_target.col(first) = observations.points_in_target.col(i);
    }
  }
  const Points3 in_camera =
      (camera_from_target.RotationMatrix() * in_target).colwise() + camera_from_target.translation;
  Points2 projected;
  ProjectionJacobian by_point;
  if (!model.Project(params, in_camera, &projected, jacobian == nullptr ? nullptr : &by_point)) return false;
  pixels->resize(2, n);
  if (jacobian != nullptr) {
    const Eigen::Index rows = 6 + NumParams(model);
    jacobian->u.setZero(rows, n);
    jacobian->v.setZero(rows, n);
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index first = begin[static_cast<size_t>(i)];
    Eigen::VectorXd column_u;
    Eigen::VectorXd column_v;
    if (jacobian != nullptr) {
      column_u.setZero(jacobian->u.rows());
      column_v.setZero(jacobian->v.rows());
    }
    if (begin[static_cast<size_t>(i) + 1] == first + 1) {
      pixels->col(i) = projected.col(first);
      if (jacobian != nullptr) {
        AddToPoseColumn(by_point.u, first, in_camera, 1, column_u);
        AddToPoseColumn(by_point.v, first, in_camera, 1, column_v);
      }
    } else {
      const Centroid centroid = CentroidOf(projected.row(0).segment<kOutline>(first),
                                           projected.row(1).segment<kOutline>(first), jacobian != nullptr);
      if (!centroid.at.allFinite()) return false;
      pixels->col(i) = centroid.at;
      for (int k = 0; jacobian != nullptr && k < kOutline; ++k) {
        AddToPoseColumn(by_point.u, first + k, in_camera, centroid.by_u(0, k), column_u);
        AddToPoseColumn(by_point.v, first + k, in_camera, centroid.by_v(0, k), column_u);
        AddToPoseColumn(by_point.u, first + k, in_camera, centroid.by_u(1, k), column_v);
        AddToPoseColumn(by_point.v, first + k, in_camera, centroid.by_v(1, k), column_v);
      }
    }
    if (jacobian != nullptr) {
      jacobian->u.col(i) = column_u;
      jacobian->v.col(i) = column_v;
    }
  }
  return true;
}

}  // namespace heba
