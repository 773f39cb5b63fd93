#include "heba/geometry/homography.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/base/levenberg_marquardt.h"

namespace heba {
namespace {

// Returns the similarity that maps the points to mean 0 and mean distance sqrt(2).
Eigen::Matrix3d Normalisation(const Eigen::Matrix2Xd& points) {
  const Eigen::Vector2d mean = points.rowwise().mean();
  const double distance = (points.colwise() - mean).colwise().norm().mean();
  const double scale = distance > 0 ? std::sqrt(2.0) / distance : 1.0;
  Eigen::Matrix3d transform;
  transform << scale, 0, -scale * mean.x(), 0, scale, -scale * mean.y(), 0, 0, 1;
  return transform;
}

// Returns the ratio of the second to the first singular value of the centred points: 0 for collinear points.
double Flatness(const Eigen::Matrix2Xd& points) {
  const Eigen::Vector2d mean = points.rowwise().mean();
  const Eigen::Matrix2Xd centred = points.colwise() - mean;
  const SymmetricEigen<2> eigen = EigenOfSymmetric(centred * centred.transpose());
  return std::sqrt(std::max(0.0, eigen.values[0]) / eigen.values[1]);
}

}  // namespace

std::optional<Eigen::Matrix3d> LinearHomography(const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to) {
  CHECK_EQ(from.cols(), to.cols());
  constexpr double kOnALine = 1e-6;
  if (from.cols() < 4 || !from.allFinite() || !to.allFinite()) return std::nullopt;
  if (Flatness(from) < kOnALine || Flatness(to) < kOnALine) return std::nullopt;
  const Eigen::Matrix3d from_normalisation = Normalisation(from);
  const Eigen::Matrix3d to_normalisation = Normalisation(to);
  // The normal equations of [p, 0, -q_x p] h = 0 and [0, p, -q_y p] h = 0.
  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  Matrix9 products = Matrix9::Zero();
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    const Eigen::Vector3d p = from_normalisation * from.col(i).homogeneous();
    const Eigen::Vector3d q = to_normalisation * to.col(i).homogeneous();
    const Eigen::Matrix3d pp = p * p.transpose();
    products.topLeftCorner<3, 3>() += pp;
    products.block<3, 3>(6, 0) -= q.x() * pp;
    products.block<3, 3>(6, 3) -= q.y() * pp;
    products.bottomRightCorner<3, 3>() += q.head<2>().squaredNorm() * pp;
  }
  products.block<3, 3>(3, 3) = products.topLeftCorner<3, 3>();
  const SymmetricEigen<9> eigen = EigenOfSymmetric(products);  // Reads the lower triangle only.
  // A second null direction means that the points do not determine the homography.
  constexpr double kNull = 1e-14;  // Round-off of the products: 1e-7 in the equations themselves.
  if (eigen.values[1] < kNull * eigen.values[8]) return std::nullopt;
  const Eigen::Matrix<double, 9, 1> h = eigen.vectors.col(0);
  const Eigen::Matrix3d normalised = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data());
  return Eigen::Matrix3d(to_normalisation.inverse() * normalised * from_normalisation);
}

namespace {

using Vector8 = Eigen::Matrix<double, 8, 1>;
using Matrix8 = Eigen::Matrix<double, 8, 8>;

// A homography in normalised coordinates, whose last element is 1, and the normal equations of the distances there.
struct HomographyPoint {
  Eigen::Matrix3d homography;
  Matrix8 normal = Matrix8::Zero();
  Vector8 gradient = Vector8::Zero();
  double cost = 0;
};

// Returns nothing if a point is mapped to infinity or beyond.
std::optional<HomographyPoint> PointAt(const Eigen::Matrix3d& homography, const Eigen::Matrix2Xd& from,
                                       const Eigen::Matrix2Xd& to) {
  HomographyPoint point{homography};
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    const Eigen::Vector3d p = from.col(i).homogeneous();
    const Eigen::Vector3d mapped = homography * p;
    constexpr double kInfinity = 1e-9;
    if (!(mapped.z() > kInfinity)) return std::nullopt;
    const Eigen::Vector2d at = mapped.hnormalized();
    const Eigen::Vector2d residual = at - to.col(i);
    Eigen::Matrix<double, 2, 8> jacobian;
    jacobian << p.transpose(), 0, 0, 0, -at.x() * p.head<2>().transpose(), 0, 0, 0, p.transpose(),
        -at.y() * p.head<2>().transpose();
    jacobian /= mapped.z();
    point.normal += jacobian.transpose() * jacobian;
    point.gradient += jacobian.transpose() * residual;
    point.cost += residual.squaredNorm();
  }
  return point;
}

}  // namespace

std::optional<Eigen::Matrix3d> FitHomography(const std::vector<Eigen::Vector2d>& from,
                                             const std::vector<Eigen::Vector2d>& to) {
  const auto columns = [](const std::vector<Eigen::Vector2d>& points) {
    Eigen::Matrix2Xd matrix(2, points.size());
    for (size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
    return matrix;
  };
  const Eigen::Matrix2Xd from_columns = columns(from);
  const Eigen::Matrix2Xd to_columns = columns(to);
  const std::optional<Eigen::Matrix3d> linear = LinearHomography(from_columns, to_columns);
  constexpr size_t kExact = 4;
  if (!linear || from.size() == kExact) return linear;
  // The normalisation of `to` is a similarity, so that distances keep their ratios. That of `from` moves the mean to
  // the origin: the last element is the mean's depth, which is not zero.
  const Eigen::Matrix3d from_normalisation = Normalisation(from_columns);
  const Eigen::Matrix3d to_normalisation = Normalisation(to_columns);
  const Eigen::Matrix2Xd from_normalised = (from_normalisation * from_columns.colwise().homogeneous()).topRows<2>();
  const Eigen::Matrix2Xd to_normalised = (to_normalisation * to_columns.colwise().homogeneous()).topRows<2>();
  Eigen::Matrix3d start = to_normalisation * *linear * from_normalisation.inverse();
  start /= start(2, 2);
  std::optional<HomographyPoint> point = PointAt(start, from_normalised, to_normalised);
  if (!point) return linear;
  const auto try_step = [&](const HomographyPoint& at, const Vector8& step) {
    Eigen::Matrix3d next = at.homography;
    next.row(0) += step.head<3>().transpose();
    next.row(1) += step.segment<3>(3).transpose();
    next.row(2).head<2>() += step.tail<2>().transpose();
    return PointAt(next, from_normalised, to_normalised);
  };
  MinimiseSquares({}, try_step, &*point);
  return Eigen::Matrix3d(to_normalisation.inverse() * point->homography * from_normalisation);
}

Eigen::Vector2d ApplyHomography(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point) {
  return (homography * point.homogeneous()).hnormalized();
}

double AreaScale(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point) {
  const double depth = homography.row(2).dot(point.homogeneous());
  return homography.determinant() / (depth * depth * depth);
}

}  // namespace heba
