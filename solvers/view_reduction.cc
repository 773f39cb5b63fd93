#include "solvers/view_reduction.h"

#include <cmath>

#include <Eigen/QR>

namespace heba {
namespace {

Points3 Transform(const Rigid3d& camera_from_target, const Points3& points_in_target) {
  return (camera_from_target.RotationMatrix() * points_in_target).colwise() + camera_from_target.translation;
}

}  // namespace

int NumReducedRows(const CameraModel& model, const Observations& observations) {
  return std::min(2 * observations.size(), 6 + NumParams(model) + 1);
}

bool ReduceView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                const Observations& observations, double pixel_sigma_px, const Loss& loss, ViewReduction* reduction) {
  const Points3 points = Transform(camera_from_target, observations.points_in_target);
  Points2 pixels;
  ProjectionJacobian jacobian;
  if (!model.Project(params, points, &pixels, &jacobian)) return false;
  const int n = observations.size();
  const int num_params = NumParams(model);
  const int columns = 6 + num_params + 1;
  Eigen::MatrixXd rows(2 * n, columns);
  double sum_rho = 0;
  double sum_weighted = 0;
  for (int i = 0; i < n; ++i) {
    const double du = (pixels(0, i) - observations.pixels(0, i)) / pixel_sigma_px;
    const double dv = (pixels(1, i) - observations.pixels(1, i)) / pixel_sigma_px;
    const double s = du * du + dv * dv;
    const double weight = loss.weight(s);
    sum_rho += loss.rho(s);
    sum_weighted += weight * s;
    const double root = std::sqrt(weight);
    const double scale = root / pixel_sigma_px;
    const double x = points(0, i);
    const double y = points(1, i);
    const double z = points(2, i);
    const auto fill = [&](int row, const ProjectionJacobian::Rows& d, double residual) {
      const double dx = scale * d(0, i);
      const double dy = scale * d(1, i);
      const double dz = scale * d(2, i);
      rows(row, 0) = dx;
      rows(row, 1) = dy;
      rows(row, 2) = dz;
      // d p / d w = -skew(p), so the row is p x (dx, dy, dz).
      rows(row, 3) = y * dz - z * dy;
      rows(row, 4) = z * dx - x * dz;
      rows(row, 5) = x * dy - y * dx;
      for (int j = 0; j < num_params; ++j) rows(row, 6 + j) = scale * d(3 + j, i);
      rows(row, columns - 1) = root * residual;
    };
    fill(2 * i, jacobian.u, du);
    fill(2 * i + 1, jacobian.v, dv);
  }
  reduction->loss_remainder = std::max(0.0, sum_rho - sum_weighted);
  if (rows.rows() <= columns) {
    reduction->factor = std::move(rows);
    return true;
  }
  const Eigen::HouseholderQR<Eigen::Ref<Eigen::MatrixXd>> qr(rows);
  reduction->factor = rows.topRows(columns).triangularView<Eigen::Upper>();
  return true;
}

bool ViewCost(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
              const Observations& observations, double pixel_sigma_px, const Loss& loss, double* sum_rho) {
  Points2 pixels;
  if (!model.Project(params, Transform(camera_from_target, observations.points_in_target), &pixels, nullptr))
    return false;
  const Points2 whitened = (pixels - observations.pixels) / pixel_sigma_px;
  *sum_rho = 0;
  for (Eigen::Index i = 0; i < whitened.cols(); ++i) *sum_rho += loss.rho(whitened.col(i).squaredNorm());
  return true;
}

}  // namespace heba
