#include "solvers/view_reduction.h"

#include <cmath>

#include <Eigen/QR>

#include "heba/base/error.h"
#include "heba/data/prediction.h"

namespace heba {
namespace {

// Rows come in pairs, u and v of each point. Makes those that were measured together uncorrelated.
void Whiten(const Observations& observations, Eigen::Ref<Eigen::MatrixXd> rows) {
  Eigen::Index first = 0;
  for (const Eigen::MatrixXd& block : observations.whitening) {
    rows.middleRows(first, block.rows()) =
        (block.triangularView<Eigen::Lower>() * rows.middleRows(first, block.rows())).eval();
    first += block.rows();
  }
  CHECK(first == 0 || first == rows.rows()) << "whitening must cover all points or none";
}

}  // namespace

int NumReducedRows(const CameraModel& model, const Observations& observations, bool with_shape) {
  return std::min(2 * observations.size(), 6 + NumParams(model) + (with_shape ? TargetShape::kNumParams : 0) + 1);
}

bool ReduceView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                const Observations& observations, double pixel_sigma_px, const Loss& loss, ViewReduction* reduction,
                const TargetShape* shape) {
  Observations shaped;
  if (shape != nullptr) shaped = Shaped(observations, *shape);
  Points2 pixels;
  ProjectionJacobian jacobian;
  if (!Predict(model, params, camera_from_target, shape != nullptr ? shaped : observations, &pixels, &jacobian)) {
    return false;
  }
  const int n = observations.size();
  const int num_predicted = 6 + NumParams(model);
  const int columns = num_predicted + (shape != nullptr ? TargetShape::kNumParams : 0) + 1;
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  Eigen::MatrixXd rows(2 * n, columns);
  for (int i = 0; i < n; ++i) {
    rows.row(2 * i).head(num_predicted) = jacobian.u.col(i);
    rows.row(2 * i + 1).head(num_predicted) = jacobian.v.col(i);
    if (shape != nullptr) {
      // What moves a point moves its image as a shift of the whole target would.
      const Eigen::Vector3d designed = observations.points_in_target.col(i);
      rows.block<2, TargetShape::kNumParams>(2 * i, num_predicted) =
          rows.block<2, 3>(2 * i, 0) * rotation * ShapedByParams(designed, *shape);
    }
    rows(2 * i, columns - 1) = pixels(0, i) - observations.pixels(0, i);
    rows(2 * i + 1, columns - 1) = pixels(1, i) - observations.pixels(1, i);
  }
  Whiten(observations, rows);
  rows /= pixel_sigma_px;
  double sum_rho = 0;
  double sum_weighted = 0;
  for (int i = 0; i < n; ++i) {
    const double s = rows.block<2, 1>(2 * i, columns - 1).squaredNorm();
    const double weight = loss.weight(s);
    sum_rho += loss.rho(s);
    sum_weighted += weight * s;
    rows.middleRows<2>(2 * i) *= std::sqrt(weight);
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

std::optional<std::vector<double>> WhitenedSquares(const CameraModel& model, const double* params,
                                                   const Rigid3d& camera_from_target,
                                                   const Observations& observations) {
  Points2 pixels;
  if (!Predict(model, params, camera_from_target, observations, &pixels, nullptr)) return std::nullopt;
  // Column by column: u and v of each point.
  const Eigen::Matrix2Xd residuals = pixels - observations.pixels;
  Eigen::MatrixXd rows = Eigen::Map<const Eigen::VectorXd>(residuals.data(), residuals.size());
  Whiten(observations, rows);
  std::vector<double> squares;
  for (Eigen::Index i = 0; i < residuals.cols(); ++i) squares.push_back(rows.block<2, 1>(2 * i, 0).squaredNorm());
  return squares;
}

bool ViewCost(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
              const Observations& observations, double pixel_sigma_px, const Loss& loss, double* sum_rho) {
  const std::optional<std::vector<double>> squares = WhitenedSquares(model, params, camera_from_target, observations);
  if (!squares) return false;
  *sum_rho = 0;
  for (const double s : *squares) *sum_rho += loss.rho(s / (pixel_sigma_px * pixel_sigma_px));
  return true;
}

}  // namespace heba
