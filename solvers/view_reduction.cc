#include "solvers/view_reduction.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "heba/base/column_products.h"
#include "heba/base/error.h"
#include "heba/base/simd.h"
#include "heba/data/prediction.h"

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
  constexpr int kSome = ProjectionBatch::kCapacity;
  double s[kSome];
  double rho[kSome];
  double weight[kSome];
  for (int first = 0; first < size; first += kSome) {
    const int count = std::min(kSome, size - first);
    for (int i = 0; i < count; ++i) {
      s[i] = (u[first + i] * u[first + i] + v[first + i] * v[first + i]) * per_px2;
    }
    loss.evaluate(s, count, rho, weight);
    for (int i = 0; i < count; ++i) {
      sums->rho += rho[i];
      sums->weighted += weight[i] * s[i];
      roots[first + i] = std::sqrt(weight[i]);
    }
  }
}

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

// Of one image axis, which of a batch's rows are multiplied, and which columns of the products they are.
struct AxisColumns {
  int size = 0;
  int rows[ProjectionBatch::kMaxRows];
  int places[ProjectionBatch::kMaxRows];

  void Add(int row, int place) {
    rows[size] = row;
    places[size++] = place;
  }
};

// The rows that a camera model gives, as far as they are wanted. The caller writes those of the principal point, of the
// shape and of the residual behind them: they are in no row yet.
constexpr int kWritten = -1;
// Pose, focal length, distortion, principal point, shape, residual, and what pads an odd number.
static_assert(6 + 1 + ProjectionBatch::kMaxDistortion + 1 + TargetShape::kNumParams + 1 + 1 <=
              ProjectionBatch::kMaxRows);
AxisColumns ColumnsOf(const CameraModel& model, const FreeParameters& free, int axis) {
  AxisColumns columns;
  int place = 0;
  for (; place < 6; ++place) columns.Add(place, place);
  const int num_camera = NumParams(model);
  int centre_place = -1;
  for (int i = 0; i < num_camera; ++i) {
    if (!free[static_cast<size_t>(i)]) continue;
    if (i == axis) columns.Add(6, place);
    if (i == 2 + axis) centre_place = place;
    if (i >= 4) columns.Add(7 + i - 4, place);
    ++place;
  }
  if (centre_place >= 0) columns.Add(kWritten, centre_place);
  const int num_columns = 6 + static_cast<int>(NumFree(free)) + 1;
  for (; place < num_columns; ++place) columns.Add(kWritten, place);
  return columns;
}

// Of plain points: u and v apart, since what is zero in all rows of one of them need not be multiplied.
bool MultiplyPlainView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                       const Observations& observations, double pixel_sigma_px, const Loss& loss,
                       const FreeParameters& free, const TargetShape* shape, ViewProducts* products) {
  const AxisColumns columns[] = {ColumnsOf(model, free, 0), ColumnsOf(model, free, 1)};
  const int num_camera = NumParams(model);
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  const int n = observations.size();
  ColumnProducts sums[] = {ColumnProducts(columns[0].size, ProjectionBatch::kCapacity, n),
                           ColumnProducts(columns[1].size, ProjectionBatch::kCapacity, n)};
  Sums weights;
  ProjectionBatch batch;
  for (int first = 0; first < n; first += batch.size) {
    LoadBatch(observations, shape, first, &batch);
    if (!model.ProjectBatch(params, rotation, camera_from_target.translation, true, &batch)) return false;
    const int padded = PaddedToLanes(batch.size);
    for (int axis = 0; axis < 2; ++axis) {
      auto& rows = batch.rows[axis];
      const AxisColumns& own = columns[axis];
      const double* const measured = observations.pixels.row(axis).data() + first;
      int row = 6;
      for (; own.rows[row] != kWritten; ++row) {
        if (own.rows[row] != row) std::copy_n(rows[own.rows[row]], padded, rows[row]);
      }
      if (free[static_cast<size_t>(2 + axis)]) std::fill_n(rows[row++], batch.size, 1.0);
      for (int i = 0; i < batch.size && shape != nullptr; ++i) {
        // What moves a point moves its image as a shift of the whole target would.
        const Eigen::RowVector3d by_shift(rows[0][i], rows[1][i], rows[2][i]);
        const Eigen::Matrix<double, 1, TargetShape::kNumParams> by_shape =
            by_shift * rotation * ShapedByParams(Eigen::Vector3d(observations.points_in_target.col(first + i)), *shape);
        int shape_row = row;
        for (int k = 0; k < TargetShape::kNumParams; ++k) {
          if (free[static_cast<size_t>(num_camera + k)]) rows[shape_row++][i] = by_shape[k];
        }
      }
      for (int i = 0; i < batch.size; ++i) rows[own.size - 1][i] = batch.pixels[axis][i] - measured[i];
    }
    if (IsWeighted(loss)) {
      double roots[ProjectionBatch::kCapacity];
      WeighPoints(batch.rows[0][columns[0].size - 1], batch.rows[1][columns[1].size - 1], batch.size, pixel_sigma_px,
                  loss, roots, &weights);
      for (int axis = 0; axis < 2; ++axis) {
        for (int row = 0; row < columns[axis].size; ++row) {
          for (int i = 0; i < batch.size; ++i) batch.rows[axis][row][i] *= roots[i];
        }
      }
    }
    for (int axis = 0; axis < 2; ++axis) {
      for (int row = 0; row < columns[axis].size && padded != batch.size; ++row) {
        std::fill(batch.rows[axis][row] + batch.size, batch.rows[axis][row] + padded, 0.0);
      }
      sums[axis].Add(batch.rows[axis][0], padded);
    }
  }
  const Eigen::Index num_columns = columns[0].places[columns[0].size - 1] + 1;
  products->matrix.setZero(num_columns, num_columns);
  const double per_px2 = 1 / (pixel_sigma_px * pixel_sigma_px);
  for (int axis = 0; axis < 2; ++axis) sums[axis].AddTo(columns[axis].places, per_px2, &products->matrix);
  for (Eigen::Index i = 0; i < num_columns; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) products->matrix(j, i) = products->matrix(i, j);
  }
  products->loss_remainder = weights.Remainder();
  return true;
}

// All rows of a view, whitened and weighted, in units of sigma: those of u, then those of v, each padded with zeros.
struct ViewRows {
  int padded = 0;  // Rows of u, or of v.
  Eigen::MatrixXd columns;
  Sums sums;
};
bool WriteRows(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
               const Observations& observations, double pixel_sigma_px, const Loss& loss, const FreeParameters& free,
               const TargetShape* shape, ViewRows* rows) {
  Observations shaped;
  if (shape != nullptr) shaped = Shaped(observations, *shape);
  Points2 pixels;
  ProjectionJacobian jacobian;
  if (!Predict(model, params, camera_from_target, shape != nullptr ? shaped : observations, &pixels, &jacobian)) {
    return false;
  }
  const int n = observations.size();
  const int num_camera = NumParams(model);
  const Eigen::Index num_columns = 6 + NumFree(free) + 1;
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  rows->padded = PaddedToLanes(n);
  rows->columns.setZero(2 * rows->padded, num_columns + num_columns % 2);
  const auto of_axis = [&](int axis) { return rows->columns.middleRows(axis * rows->padded, n); };
  for (int axis = 0; axis < 2; ++axis) {
    const ProjectionJacobian::Rows& predicted = axis == 0 ? jacobian.u : jacobian.v;
    auto own = of_axis(axis);
    own.leftCols<6>() = predicted.topRows<6>().transpose();
    Eigen::Index column = 6;
    for (int i = 0; i < num_camera; ++i) {
      if (free[static_cast<size_t>(i)]) own.col(column++) = predicted.row(6 + i).transpose();
    }
    own.col(num_columns - 1) = (pixels.row(axis) - observations.pixels.row(axis)).transpose();
    for (int i = 0; i < n && shape != nullptr; ++i) {
      const Eigen::Vector3d designed = observations.points_in_target.col(i);
      const Eigen::Matrix<double, 1, TargetShape::kNumParams> by_shape =
          own.block<1, 3>(i, 0) * rotation * ShapedByParams(designed, *shape);
      Eigen::Index shape_column = column;
      for (int k = 0; k < TargetShape::kNumParams; ++k) {
        if (free[static_cast<size_t>(num_camera + k)]) own(i, shape_column++) = by_shape[k];
      }
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

}  // namespace

bool MultiplyView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                  const Observations& observations, double pixel_sigma_px, const Loss& loss, const FreeParameters& free,
                  const TargetShape* shape, ViewProducts* products) {
  if (IsPlain(observations)) {
    return MultiplyPlainView(model, params, camera_from_target, observations, pixel_sigma_px, loss, free, shape,
                             products);
  }
  ViewRows rows;
  if (!WriteRows(model, params, camera_from_target, observations, pixel_sigma_px, loss, free, shape, &rows)) {
    return false;
  }
  ColumnProducts sums(6 + static_cast<int>(NumFree(free)) + 1, rows.columns.rows());
  sums.Add(rows.columns.data(), rows.columns.rows());
  products->matrix = sums.Matrix();
  products->loss_remainder = rows.sums.Remainder();
  return true;
}

Eigen::MatrixXd RootOfProducts(const Eigen::MatrixXd& products) {
  const Eigen::Index n = products.cols();
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(n, n);
  // What is left to explain, scaled to ones on the diagonal: of a symmetric matrix the lower half.
  Eigen::MatrixXd rest = products;
  Eigen::VectorXd lengths(n);
  for (Eigen::Index i = 0; i < n; ++i) lengths[i] = std::sqrt(std::max(0.0, products(i, i)));
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = j; i < n; ++i)
      rest(i, j) = lengths[i] * lengths[j] > 0 ? rest(i, j) / lengths[i] / lengths[j] : 0;
  }
  const double nothing = static_cast<double>(n) * std::numeric_limits<double>::epsilon();
  // The pivots' row, on the way.
  Eigen::VectorXd row(n);
  for (Eigen::Index step = 0; step + 1 < n; ++step) {
    Eigen::Index pivot = 0;
    if (rest.diagonal().head(n - 1).maxCoeff(&pivot) <= nothing) break;
    row.head(pivot) = rest.row(pivot).head(pivot).transpose();
    row.tail(n - pivot) = rest.col(pivot).tail(n - pivot);
    row /= std::sqrt(rest(pivot, pivot));
    for (Eigen::Index j = 0; j < n; ++j) {
      rest.col(j).tail(n - j) -= row[j] * row.tail(n - j);
      root(step, j) = row[j] * lengths[j];
    }
    rest.row(pivot).head(pivot).setZero();
    rest.col(pivot).tail(n - pivot).setZero();
  }
  root(n - 1, n - 1) = std::sqrt(std::max(0.0, rest(n - 1, n - 1))) * lengths[n - 1];
  return root;
}

bool ReduceView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                const Observations& observations, double pixel_sigma_px, const Loss& loss, const FreeParameters& free,
                const TargetShape* shape, ViewReduction* reduction) {
  const Eigen::Index num_columns = 6 + NumFree(free) + 1;
  if (2 * observations.size() > num_columns) {
    ViewProducts products;
    if (!MultiplyView(model, params, camera_from_target, observations, pixel_sigma_px, loss, free, shape, &products)) {
      return false;
    }
    reduction->factor = RootOfProducts(products.matrix);
    reduction->loss_remainder = products.loss_remainder;
    return true;
  }
  // Fewer rows than that: as they are.
  ViewRows rows;
  if (!WriteRows(model, params, camera_from_target, observations, pixel_sigma_px, loss, free, shape, &rows)) {
    return false;
  }
  const int n = observations.size();
  reduction->factor.resize(2 * n, num_columns);
  reduction->factor.topRows(n) = rows.columns.topLeftCorner(n, num_columns);
  reduction->factor.bottomRows(n) = rows.columns.block(rows.padded, 0, n, num_columns);
  reduction->loss_remainder = rows.sums.Remainder();
  return true;
}

int ThreadsFor(int num_points, int most) {
  constexpr int kPointsPerThread = 20000;
  return std::clamp(num_points / kPointsPerThread, 1, std::max(1, most));
}

std::optional<std::vector<double>> WhitenedSquares(const CameraModel& model, const double* params,
                                                   const Rigid3d& camera_from_target, const Observations& observations,
                                                   const TargetShape* shape) {
  const int n = observations.size();
  std::vector<double> squares;
  squares.reserve(static_cast<size_t>(n));
  if (IsPlain(observations)) {
    const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
    ProjectionBatch batch;
    for (int first = 0; first < n; first += batch.size) {
      LoadBatch(observations, shape, first, &batch);
      if (!model.ProjectBatch(params, rotation, camera_from_target.translation, false, &batch)) return std::nullopt;
      for (int i = 0; i < batch.size; ++i) {
        const double du = batch.pixels[0][i] - observations.pixels(0, first + i);
        const double dv = batch.pixels[1][i] - observations.pixels(1, first + i);
        squares.push_back(du * du + dv * dv);
      }
    }
    return squares;
  }
  Observations shaped;
  if (shape != nullptr) shaped = Shaped(observations, *shape);
  Points2 pixels;
  if (!Predict(model, params, camera_from_target, shape != nullptr ? shaped : observations, &pixels, nullptr)) {
    return std::nullopt;
  }
  Eigen::MatrixXd residuals(2 * n, 1);
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    residuals.middleRows(axis * n, n) = (pixels.row(axis) - observations.pixels.row(axis)).transpose();
  }
  Whiten(observations, n, &residuals);
  for (Eigen::Index i = 0; i < n; ++i) {
    squares.push_back(residuals(i, 0) * residuals(i, 0) + residuals(n + i, 0) * residuals(n + i, 0));
  }
  return squares;
}

}  // namespace heba
