#include "heba/data/prediction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace heba {
namespace {

constexpr int kOutline = 8;  // Number of points on a disc's outline.
using OutlineVector = Eigen::Matrix<double, 1, kOutline>;

// Returns the matrix that differentiates, at equally spaced samples of one period, the trigonometric polynomial through
// these samples (Trefethen 2000, Spectral Methods in MATLAB, chapter 3). The matrix is antisymmetric.
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

// The centroid of the area inside an outline, and its derivatives by the points of the outline.
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
  // Integrals over the angle, all up to the same factor: area = 1/2 (x dy - y dx), moments 1/2 x^2 dy and -1/2 y^2 dx.
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
  // Integration by parts, with the antisymmetry of the derivative matrix, gives d area = dy du - dx dv, and similarly
  // for the moments. A shift of the whole outline shifts the centroid equally, which determines the part due to the
  // mean.
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

// Returns the row of ProjectionJacobian that corresponds to a row of ProjectionBatch::rows.
int RowOf(int batch_row, int axis) { return batch_row < 6 ? batch_row : 6 + ParameterOfRow(batch_row, axis); }

// Copies the derivatives of one image coordinate of `count` points.
void CopyPoints(const ProjectionBatch& batch, int from, int count, int num_rows, int axis, Eigen::Index first,
                ProjectionJacobian::Rows* rows) {
  for (int row = 0; row < num_rows; ++row) {
    std::copy_n(&batch.rows[axis][row][from], count, &(*rows)(RowOf(row, axis), first));
  }
}

// Adds the derivatives of one coordinate of a centroid, by the chain rule from those of the points of the outline,
// which begin at `from`.
void AddOutline(const ProjectionBatch& batch, int from, int num_rows, const OutlineVector& by_u,
                const OutlineVector& by_v, Eigen::Index i, ProjectionJacobian::Rows* rows) {
  for (const int axis : {0, 1}) {
    const OutlineVector& by = axis == 0 ? by_u : by_v;
    for (int row = 0; row < num_rows; ++row) {
      (*rows)(RowOf(row, axis), i) += by.dot(Eigen::Map<const OutlineVector>(&batch.rows[axis][row][from]));
    }
  }
}

}  // namespace

bool Predict(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
             const Observations& observations, Points2* pixels, ProjectionJacobian* jacobian) {
  static const Eigen::Matrix<double, 2, kOutline> kCircle = UnitCircle();
  const int n = observations.size();
  const int num_rows = 8 + NumParams(model) - 4;  // Number of rows in a batch.
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  pixels->resize(2, n);
  if (jacobian != nullptr) {
    jacobian->u.setZero(6 + NumParams(model), n);
    jacobian->v.setZero(6 + NumParams(model), n);
  }
  const auto num_projected = [&](int i) { return observations.RadiusM(i) > 0 ? kOutline : 1; };
  static_assert(kOutline <= ProjectionBatch::kCapacity);
  ProjectionBatch batch;
  for (int first = 0; first < n;) {
    batch.size = 0;
    int last = first;
    for (; last < n && batch.size + num_projected(last) <= ProjectionBatch::kCapacity; ++last) {
      const double radius_m = observations.RadiusM(last);
      for (int k = 0; k < num_projected(last); ++k, ++batch.size) {
        for (int row = 0; row < 3; ++row) {
          batch.points[row][batch.size] =
              observations.points_in_target(row, last) + (radius_m > 0 && row < 2 ? radius_m * kCircle(row, k) : 0.0);
        }
      }
    }
    PadBatch(&batch);
    if (!model.ProjectBatch(params, rotation, camera_from_target.translation, jacobian != nullptr, &batch)) {
      return false;
    }
    int from = 0;
    for (int i = first; i < last;) {
      if (num_projected(i) == 1) {
        int count = 1;
        while (i + count < last && num_projected(i + count) == 1) ++count;
        for (const int axis : {0, 1}) std::copy_n(&batch.pixels[axis][from], count, &(*pixels)(axis, i));
        if (jacobian != nullptr) {
          CopyPoints(batch, from, count, num_rows, 0, i, &jacobian->u);
          CopyPoints(batch, from, count, num_rows, 1, i, &jacobian->v);
        }
        i += count;
        from += count;
        continue;
      }
      const Centroid centroid =
          CentroidOf(Eigen::Map<const OutlineVector>(&batch.pixels[0][from]),
                     Eigen::Map<const OutlineVector>(&batch.pixels[1][from]), jacobian != nullptr);
      if (!centroid.at.allFinite()) return false;
      pixels->col(i) = centroid.at;
      if (jacobian != nullptr) {
        AddOutline(batch, from, num_rows, centroid.by_u.row(0), centroid.by_v.row(0), i, &jacobian->u);
        AddOutline(batch, from, num_rows, centroid.by_u.row(1), centroid.by_v.row(1), i, &jacobian->v);
      }
      ++i;
      from += kOutline;
    }
    first = last;
  }
  return true;
}

}  // namespace heba
