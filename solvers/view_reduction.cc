#include "solvers/view_reduction.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "heba/base/error.h"
#include "heba/base/simd.h"
#include "heba/data/prediction.h"
#include "solvers/column_products.h"

namespace heba {
namespace {

// Of points that were measured one by one: u' = a u, v' = b u + c v.
void WhitenPoints(const std::vector<Eigen::MatrixXd>& blocks, Eigen::Index v_offset, Eigen::MatrixXd* columns) {
  const auto n = static_cast<Eigen::Index>(blocks.size());
  Eigen::ArrayX3d factors(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::MatrixXd& block = blocks[static_cast<size_t>(i)];
    factors.row(i) << block(0, 0), block(1, 0), block(1, 1);
  }
  for (Eigen::Index c = 0; c < columns->cols(); ++c) {
    auto u = columns->col(c).head(n).array();
    auto v = columns->col(c).segment(v_offset, n).array();
    v = factors.col(2) * v + factors.col(1) * u;
    u *= factors.col(0);
  }
}

// Of points of which several were measured together, as a tag's corners.
void WhitenBlock(const Eigen::MatrixXd& block, double* u, double* v) {
  // From the last row up: a row needs those before it only.
  for (Eigen::Index i = block.rows() / 2 - 1; i >= 0; --i) {
    double whitened_u = block(2 * i, 2 * i) * u[i];
    double whitened_v = block(2 * i + 1, 2 * i) * u[i] + block(2 * i + 1, 2 * i + 1) * v[i];
    for (Eigen::Index k = 0; k < i; ++k) {
      whitened_u += block(2 * i, 2 * k) * u[k] + block(2 * i, 2 * k + 1) * v[k];
      whitened_v += block(2 * i + 1, 2 * k) * u[k] + block(2 * i + 1, 2 * k + 1) * v[k];
    }
    u[i] = whitened_u;
    v[i] = whitened_v;
  }
}

// Makes what was measured together uncorrelated. In `columns` the rows of v begin `v_offset` after those of u; a block
// of the whitening has them in turn.
void Whiten(const Observations& observations, Eigen::Index v_offset, Eigen::MatrixXd* columns) {
  const std::vector<Eigen::MatrixXd>& blocks = observations.whitening;
  Eigen::Index num_points = 0;
  for (const Eigen::MatrixXd& block : blocks) num_points += block.rows() / 2;
  CHECK(num_points == 0 || num_points == observations.size()) << "whitening must cover all points or none";
  if (static_cast<size_t>(num_points) == blocks.size()) {
    WhitenPoints(blocks, v_offset, columns);
    return;
  }
  for (Eigen::Index c = 0; c < columns->cols(); ++c) {
    double* u = columns->col(c).data();
    for (const Eigen::MatrixXd& block : blocks) {
      WhitenBlock(block, u, u + v_offset);
      u += block.rows() / 2;
    }
  }
}

// What a pass over a view's points adds up.
struct Sums {
  double rho = 0;
  double weighted = 0;
  double Remainder() const { return std::max(0.0, rho - weighted); }
};

// Or all points count alike.
bool IsWeighted(const Loss& loss) { return loss.name != "none"; }

// The square roots of the weights of points with these whitened residuals; `sums` grows.
void WeighPoints(const double* u, const double* v, int size, double pixel_sigma_px, const Loss& loss, double* roots,
                 Sums* sums) {
  const double per_px2 = 1 / (pixel_sigma_px * pixel_sigma_px);
  for (int i = 0; i < size; ++i) {
    const double s = (u[i] * u[i] + v[i] * v[i]) * per_px2;
    const double weight = loss.weight(s);
    sums->rho += loss.rho(s);
    sums->weighted += weight * s;
    roots[i] = std::sqrt(weight);
  }
}

int PaddedSize(int size) { return (size + kMaxLanes - 1) / kMaxLanes * kMaxLanes; }

// Whether the points' rows are as the camera model gives them: no discs, no correlated noise.
bool IsPlain(const Observations& observations) {
  return observations.whitening.empty() && (observations.radii_m.size() == 0 || observations.radii_m.maxCoeff() <= 0);
}

// The points from `first` on, as many as a batch holds.
void LoadBatch(const Observations& observations, const TargetShape* shape, int first, ProjectionBatch* batch) {
  batch->size = std::min(observations.size() - first, ProjectionBatch::kCapacity);
  for (int k = 0; k < 3; ++k) {
    std::copy_n(observations.points_in_target.row(k).data() + first, batch->size, batch->points[k]);
  }
  for (int i = 0; i < batch->size && shape != nullptr; ++i) {
    const Eigen::Vector3d at = Shaped(Eigen::Vector3d(observations.points_in_target.col(first + i)), *shape);
    for (int k = 0; k < 3; ++k) batch->points[k][i] = at[k];
  }
  PadBatch(batch);
}

// Adds `from` to `to`, column k of the one being column places[k] of the other.
void AddAt(const Eigen::MatrixXd& from, const std::vector<Eigen::Index>& places, Eigen::MatrixXd* to) {
  for (size_t i = 0; i < places.size(); ++i) {
    for (size_t j = 0; j < places.size(); ++j) {
      (*to)(places[i], places[j]) += from(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
  }
}

// Of plain points: u and v apart, since what is zero in all rows of one of them need not be multiplied.
bool MultiplyPlainView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                       const Observations& observations, double pixel_sigma_px, const Loss& loss,
                       const TargetShape* shape, ViewProducts* products) {
  constexpr int kNumPose = 6;
  const int num_distortion = NumParams(model) - 4;
  const int num_shape = shape == nullptr ? 0 : TargetShape::kNumParams;
  // Rows of the batch: pose, focal length, distortion by the model, then the principal point, the shape, the residual.
  const int centre_row = kNumPose + 1 + num_distortion;
  const int shape_row = centre_row + 1;
  const int residual_row = shape_row + num_shape;
  const int num_rows = residual_row + 1;
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  ColumnProducts sums_u(num_rows, ProjectionBatch::kCapacity);
  ColumnProducts sums_v(num_rows, ProjectionBatch::kCapacity);
  Sums sums;
  ProjectionBatch batch;
  const int n = observations.size();
  for (int first = 0; first < n; first += batch.size) {
    LoadBatch(observations, shape, first, &batch);
    if (!model.ProjectBatch(params, rotation, camera_from_target.translation, true, &batch)) return false;
    for (int axis = 0; axis < 2; ++axis) {
      auto& rows = batch.rows[axis];
      const double* const measured = observations.pixels.row(axis).data() + first;
      for (int i = 0; i < batch.size; ++i) rows[residual_row][i] = batch.pixels[axis][i] - measured[i];
      std::fill_n(rows[centre_row], batch.size, 1.0);
      for (int i = 0; i < batch.size && shape != nullptr; ++i) {
        // What moves a point moves its image as a shift of the whole target would.
        const Eigen::RowVector3d by_shift(rows[0][i], rows[1][i], rows[2][i]);
        const Eigen::Matrix<double, 1, TargetShape::kNumParams> by_shape =
            by_shift * rotation * ShapedByParams(Eigen::Vector3d(observations.points_in_target.col(first + i)), *shape);
        for (int k = 0; k < num_shape; ++k) rows[shape_row + k][i] = by_shape[k];
      }
    }
    const int padded = PaddedSize(batch.size);
    if (IsWeighted(loss)) {
      double roots[ProjectionBatch::kCapacity];
      WeighPoints(batch.rows[0][residual_row], batch.rows[1][residual_row], batch.size, pixel_sigma_px, loss, roots,
                  &sums);
      for (auto& rows : batch.rows) {
        for (int row = 0; row < num_rows; ++row) {
          for (int i = 0; i < batch.size; ++i) rows[row][i] *= roots[i];
        }
      }
    }
    if (padded != batch.size) {
      for (auto& rows : batch.rows) {
        for (int row = 0; row < num_rows; ++row) std::fill(rows[row] + batch.size, rows[row] + padded, 0.0);
      }
    }
    sums_u.Add(batch.rows[0][0], padded);
    sums_v.Add(batch.rows[1][0], padded);
  }
  const Eigen::Index num_columns = kNumPose + NumParams(model) + num_shape + 1;
  products->matrix.setZero(num_columns, num_columns);
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<Eigen::Index> places = {0, 1, 2, 3, 4, 5, kNumPose + axis};
    for (int k = 0; k < num_distortion; ++k) places.push_back(kNumPose + 4 + k);
    places.push_back(kNumPose + 2 + axis);
    for (Eigen::Index k = num_columns - 1 - num_shape; k < num_columns; ++k) places.push_back(k);
    AddAt((axis == 0 ? sums_u : sums_v).Matrix(), places, &products->matrix);
  }
  products->matrix /= pixel_sigma_px * pixel_sigma_px;
  products->loss_remainder = sums.Remainder();
  return true;
}

// All rows of a view, whitened and weighted, in units of sigma: those of u, then those of v, each padded with zeros.
struct ViewRows {
  int padded = 0;  // Rows of u, or of v.
  Eigen::MatrixXd columns;
  Sums sums;
};
bool WriteRows(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
               const Observations& observations, double pixel_sigma_px, const Loss& loss, const TargetShape* shape,
               ViewRows* rows) {
  Observations shaped;
  if (shape != nullptr) shaped = Shaped(observations, *shape);
  Points2 pixels;
  ProjectionJacobian jacobian;
  if (!Predict(model, params, camera_from_target, shape != nullptr ? shaped : observations, &pixels, &jacobian)) {
    return false;
  }
  const int n = observations.size();
  const int num_predicted = 6 + NumParams(model);
  const int num_columns = num_predicted + (shape != nullptr ? TargetShape::kNumParams : 0) + 1;
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  rows->padded = PaddedSize(n);
  rows->columns.setZero(2 * rows->padded, num_columns + num_columns % 2);
  const auto of_axis = [&](int axis) { return rows->columns.middleRows(axis * rows->padded, n); };
  for (int axis = 0; axis < 2; ++axis) {
    const ProjectionJacobian::Rows& predicted = axis == 0 ? jacobian.u : jacobian.v;
    auto own = of_axis(axis);
    own.leftCols(num_predicted) = predicted.transpose();
    own.col(num_columns - 1) = (pixels.row(axis) - observations.pixels.row(axis)).transpose();
    for (int i = 0; i < n && shape != nullptr; ++i) {
      const Eigen::Vector3d designed = observations.points_in_target.col(i);
      own.block<1, TargetShape::kNumParams>(i, num_predicted) =
          own.block<1, 3>(i, 0) * rotation * ShapedByParams(designed, *shape);
    }
  }
  Whiten(observations, rows->padded, &rows->columns);
  if (IsWeighted(loss)) {
    Eigen::ArrayXd roots(n);
    const double* const residuals = rows->columns.col(num_columns - 1).data();
    WeighPoints(residuals, residuals + rows->padded, n, pixel_sigma_px, loss, roots.data(), &rows->sums);
    for (int axis = 0; axis < 2; ++axis) of_axis(axis).array().colwise() *= roots;
  }
  rows->columns /= pixel_sigma_px;
  return true;
}

int NumColumns(const CameraModel& model, const TargetShape* shape) {
  return 6 + NumParams(model) + (shape != nullptr ? TargetShape::kNumParams : 0) + 1;
}

}  // namespace

int NumReducedRows(const CameraModel& model, const Observations& observations, bool with_shape) {
  return std::min(2 * observations.size(), 6 + NumParams(model) + (with_shape ? TargetShape::kNumParams : 0) + 1);
}

bool MultiplyView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                  const Observations& observations, double pixel_sigma_px, const Loss& loss, const TargetShape* shape,
                  ViewProducts* products) {
  if (IsPlain(observations)) {
    return MultiplyPlainView(model, params, camera_from_target, observations, pixel_sigma_px, loss, shape, products);
  }
  ViewRows rows;
  if (!WriteRows(model, params, camera_from_target, observations, pixel_sigma_px, loss, shape, &rows)) return false;
  ColumnProducts sums(NumColumns(model, shape), rows.columns.rows());
  sums.Add(rows.columns.data(), rows.columns.rows());
  products->matrix = sums.Matrix();
  products->loss_remainder = rows.sums.Remainder();
  return true;
}

Eigen::MatrixXd RootOfProducts(const Eigen::MatrixXd& products) {
  const Eigen::Index n = products.cols();
  const Eigen::VectorXd lengths = products.diagonal().cwiseMax(0).cwiseSqrt();
  const Eigen::VectorXd scale = lengths.unaryExpr([](double length) { return length > 0 ? 1 / length : 0.0; });
  // What is left to explain.
  Eigen::MatrixXd rest = scale.asDiagonal() * products * scale.asDiagonal();
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(n, n);
  const double nothing = static_cast<double>(n) * std::numeric_limits<double>::epsilon();
  for (Eigen::Index row = 0; row + 1 < n; ++row) {
    Eigen::Index pivot = 0;
    if (rest.diagonal().head(n - 1).maxCoeff(&pivot) <= nothing) break;
    root.row(row) = rest.row(pivot) / std::sqrt(rest(pivot, pivot));
    rest.noalias() -= root.row(row).transpose() * root.row(row);
    rest.row(pivot).setZero();
    rest.col(pivot).setZero();
  }
  root(n - 1, n - 1) = std::sqrt(std::max(0.0, rest(n - 1, n - 1)));
  return root * lengths.asDiagonal();
}

bool ReduceView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                const Observations& observations, double pixel_sigma_px, const Loss& loss, ViewReduction* reduction,
                const TargetShape* shape) {
  const int num_columns = NumColumns(model, shape);
  if (2 * observations.size() > num_columns) {
    ViewProducts products;
    if (!MultiplyView(model, params, camera_from_target, observations, pixel_sigma_px, loss, shape, &products)) {
      return false;
    }
    reduction->factor = RootOfProducts(products.matrix);
    reduction->loss_remainder = products.loss_remainder;
    return true;
  }
  // Fewer rows than that: as they are.
  ViewRows rows;
  if (!WriteRows(model, params, camera_from_target, observations, pixel_sigma_px, loss, shape, &rows)) return false;
  const int n = observations.size();
  reduction->factor.resize(2 * n, num_columns);
  reduction->factor.topRows(n) = rows.columns.topLeftCorner(n, num_columns);
  reduction->factor.bottomRows(n) = rows.columns.block(rows.padded, 0, n, num_columns);
  reduction->loss_remainder = rows.sums.Remainder();
  return true;
}

bool AppendWhitenedSquares(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                           const Observations& observations, const TargetShape* shape, std::vector<double>* squares) {
  const int n = observations.size();
  if (IsPlain(observations)) {
    const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
    ProjectionBatch batch;
    for (int first = 0; first < n; first += batch.size) {
      LoadBatch(observations, shape, first, &batch);
      if (!model.ProjectBatch(params, rotation, camera_from_target.translation, false, &batch)) return false;
      for (int i = 0; i < batch.size; ++i) {
        const double du = batch.pixels[0][i] - observations.pixels(0, first + i);
        const double dv = batch.pixels[1][i] - observations.pixels(1, first + i);
        squares->push_back(du * du + dv * dv);
      }
    }
    return true;
  }
  Observations shaped;
  if (shape != nullptr) shaped = Shaped(observations, *shape);
  Points2 pixels;
  if (!Predict(model, params, camera_from_target, shape != nullptr ? shaped : observations, &pixels, nullptr)) {
    return false;
  }
  Eigen::MatrixXd residuals(2 * n, 1);
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    residuals.middleRows(axis * n, n) = (pixels.row(axis) - observations.pixels.row(axis)).transpose();
  }
  Whiten(observations, n, &residuals);
  for (Eigen::Index i = 0; i < n; ++i) {
    squares->push_back(residuals(i, 0) * residuals(i, 0) + residuals(n + i, 0) * residuals(n + i, 0));
  }
  return true;
}

bool ViewCost(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
              const Observations& observations, double pixel_sigma_px, const Loss& loss, double* sum_rho) {
  std::vector<double> squares;
  if (!AppendWhitenedSquares(model, params, camera_from_target, observations, nullptr, &squares)) return false;
  *sum_rho = 0;
  for (const double s : squares) *sum_rho += loss.rho(s / (pixel_sigma_px * pixel_sigma_px));
  return true;
}

}  // namespace heba
