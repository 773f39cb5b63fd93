#include "heba/geometry/homography.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "heba/base/error.h"

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
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(centred * centred.transpose());
  return std::sqrt(std::max(0.0, eigen.eigenvalues()[0]) / eigen.eigenvalues()[1]);
}

}  // namespace

std::optional<Eigen::Matrix3d> FitHomographyOfColumns(const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to) {
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
  const Eigen::SelfAdjointEigenSolver<Matrix9> eigen(products);  // Reads the lower triangle only.
  // A second null direction means that the points do not determine the homography.
  constexpr double kNull = 1e-14;  // Round-off of the products: 1e-7 in the equations themselves.
  if (eigen.eigenvalues()[1] < kNull * eigen.eigenvalues()[8]) return std::nullopt;
  const Eigen::Matrix<double, 9, 1> h = eigen.eigenvectors().col(0);
  const Eigen::Matrix3d normalised = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data());
  return Eigen::Matrix3d(to_normalisation.inverse() * normalised * from_normalisation);
}

std::optional<Eigen::Matrix3d> FitHomography(const std::vector<Eigen::Vector2d>& from,
                                             const std::vector<Eigen::Vector2d>& to) {
  const auto columns = [](const std::vector<Eigen::Vector2d>& points) {
    Eigen::Matrix2Xd matrix(2, points.size());
    for (size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = points[i];
    return matrix;
  };
  return FitHomographyOfColumns(columns(from), columns(to));
}

Eigen::Vector2d ApplyHomography(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point) {
  return (homography * point.homogeneous()).hnormalized();
}

}  // namespace heba
