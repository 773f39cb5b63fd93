#include "solvers/residuals/view_reduction.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "heba/base/error.h"
#include "heba/base/factorisation.h"
#include "heba/data/prediction.h"
#include "heba/kernels/gram_matrix.h"
#include "heba/kernels/simd.h"

namespace heba {
namespace {

// Whitens points that were measured one by one: u' = a u, v' = b u + c v.
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

// Whitens one block of points that were measured together, such as the corners of a tag.
void WhitenBlock(const Eigen::MatrixXd& block, double* u, double* v) {
  // The last row comes first: each row depends only on itself and the rows before it.
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

// Multiplies every column by the whitening, which makes the coordinates uncorrelated. In `columns` the rows of v
// begin `v_offset` after those of u; in a block of the whitening u and v alternate.
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

// Returns whether the points are weighted depending on their residuals.
bool IsWeighted(const Loss& loss) { return loss.kind != LossKind::kNone; }

// Returns whether the rows of the points are those of the camera model: no discs, no whitening.
bool IsPlain(const Observations& observations) {
  return observations.whitening.empty() && (observations.radii_m.size() == 0 || observations.radii_m.maxCoeff() <= 0);
}

// Loads the points from index `first` on, at most as many as a batch holds.
void LoadBatch(const Observations& observations, const TargetShape* shape, int first, ProjectionBatch* batch) {
  batch->size = std::min(observations.size() - first, ProjectionBatch::kCapacity);
  for (int k = 0; k < 3; ++k) {
    std::copy_n(observations.points_in_target.row(k).data() + first, batch->size, batch->points[k]);
  }
  for (int i = 0; i < batch->size && shape != nullptr; ++i) {
    const Eigen::Vector3d at = ApplyShape(Eigen::Vector3d(observations.points_in_target.col(first + i)), *shape);
    for (int k = 0; k < 3; ++k) batch->points[k][i] = at[k];
  }
  PadBatch(batch);
}

// Writes the rows of the shape's free parameters for one image axis, from index `row` of the batch's rows on.
void WriteShapeRows(const Observations& observations, int first, const Eigen::Matrix3d& rotation,
                    const TargetShape& shape, const std::vector<int>& free_shape, int row,
                    double (*rows)[ProjectionBatch::kCapacity], int size) {
  for (int i = 0; i < size; ++i) {
    // Chain rule: displacing a point changes its projection as the same translation of the whole target would.
    const Eigen::RowVector3d by_position = Eigen::RowVector3d(rows[0][i], rows[1][i], rows[2][i]) * rotation;
    const auto by_params = ShapedByParams(Eigen::Vector3d(observations.points_in_target.col(first + i)), shape);
    for (size_t k = 0; k < free_shape.size(); ++k) {
      rows[row + static_cast<int>(k)][i] = by_position.dot(by_params.col(free_shape[k]));
    }
  }
}

}  // namespace

// Sums over the points of a view, accumulated in one pass.
struct ViewReducer::Sums {
  double rho = 0;
  double weighted = 0;
  double Remainder() const { return std::max(0.0, rho - weighted); }
};

ViewReducer::ViewReducer(const CameraModel& model, const FreeParameters& free, double pixel_sigma_px, const Loss& loss)
    : model_(model),
      pixel_sigma_px_(pixel_sigma_px),
      loss_(loss),
      num_columns_(6 + static_cast<int>(NumFree(free)) + 1) {
  const size_t num_params = static_cast<size_t>(NumParams(model));
  CHECK(free.size() == num_params || free.size() == num_params + TargetShape::kNumParams) << free.size();
  // Pose, focal length, principal point, distortion, shape, residual, and one column that pads an odd number.
  static_assert(6 + 2 + ProjectionBatch::kMaxDistortion + TargetShape::kNumParams + 1 + 1 <= ProjectionBatch::kMaxRows);
  for (int axis = 0; axis < 2; ++axis) {
    AxisColumns& own = axes_[axis];
    int place = 0;
    const auto add = [&](int row) {
      own.rows.push_back(row);
      own.places.push_back(place);
    };
    for (; place < 6; ++place) add(place);
    for (int i = 0; i < NumParams(model); ++i) {
      if (!free[static_cast<size_t>(i)]) continue;
      if (i >= 4 || i % 2 == axis) add(i < 4 ? 6 + i / 2 : 4 + i);
      ++place;
    }
    // The columns of shape and residual follow; their rows are written separately.
    for (; place < num_columns_; ++place) own.places.push_back(place);
  }
  for (size_t i = static_cast<size_t>(NumParams(model)); i < free.size(); ++i) {
    if (free[i]) free_shape_.push_back(static_cast<int>(i) - NumParams(model));
  }
}

// Computes the square roots of the points' weights from their whitened residuals, and adds to `sums`.
void ViewReducer::WeighPoints(const double* u, const double* v, int size, double* roots, Sums* sums) const {
  const double per_px2 = 1 / (pixel_sigma_px_ * pixel_sigma_px_);
  constexpr int kSome = ProjectionBatch::kCapacity;
  double s[kSome];
  double rho[kSome];
  double weight[kSome];
  for (int first = 0; first < size; first += kSome) {
    const int count = std::min(kSome, size - first);
    for (int i = 0; i < count; ++i) {
      s[i] = (u[first + i] * u[first + i] + v[first + i] * v[first + i]) * per_px2;
    }
    loss_.evaluate(s, count, rho, weight);
    for (int i = 0; i < count; ++i) {
      sums->rho += rho[i];
      sums->weighted += weight[i] * s[i];
      roots[first + i] = std::sqrt(weight[i]);
    }
  }
}

// Writes the rows of plain points from index `first` on, at most as many as a batch holds; each axis has its own
// columns.
bool ViewReducer::WriteBatch(const double* params, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                             const Observations& observations, const TargetShape* shape, int first,
                             ProjectionBatch* batch) const {
  CHECK(shape != nullptr || free_shape_.empty());
  LoadBatch(observations, shape, first, batch);
  if (!model_.ProjectBatch(params, rotation, translation, true, batch)) return false;
  const int padded = PaddedToLanes(batch->size);
  for (int axis = 0; axis < 2; ++axis) {
    auto& rows = batch->rows[axis];
    int row = 6;
    for (; row < static_cast<int>(axes_[axis].rows.size()); ++row) {
      const int from = axes_[axis].rows[static_cast<size_t>(row)];
      if (from != row) std::copy_n(rows[from], padded, rows[row]);
    }
    if (shape != nullptr && !free_shape_.empty()) {
      WriteShapeRows(observations, first, rotation, *shape, free_shape_, row, rows, batch->size);
      row += static_cast<int>(free_shape_.size());
    }
    const double* const measured = observations.pixels.row(axis).data() + first;
    for (int i = 0; i < batch->size; ++i) rows[row][i] = batch->pixels[axis][i] - measured[i];
  }
  return true;
}

// Computes the normal equations of plain points. The axes u and v are treated separately, because columns that are
// zero for one axis need not be multiplied.
bool ViewReducer::MultiplyPlain(const double* params, const Rigid3d& camera_from_target,
                                const Observations& observations, const TargetShape* shape,
                                ViewNormalEquations* products) const {
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  const int n = observations.size();
  const int sizes[] = {axes_[0].size(), axes_[1].size()};
  GramMatrix products_of[] = {GramMatrix(sizes[0], ProjectionBatch::kCapacity, n),
                              GramMatrix(sizes[1], ProjectionBatch::kCapacity, n)};
  Sums sums;
  ProjectionBatch batch;
  for (int first = 0; first < n; first += batch.size) {
    if (!WriteBatch(params, rotation, camera_from_target.translation, observations, shape, first, &batch)) return false;
    const int padded = PaddedToLanes(batch.size);
    if (IsWeighted(loss_)) {
      double roots[ProjectionBatch::kCapacity];
      WeighPoints(batch.rows[0][sizes[0] - 1], batch.rows[1][sizes[1] - 1], batch.size, roots, &sums);
      for (int axis = 0; axis < 2; ++axis) {
        for (int row = 0; row < sizes[axis]; ++row) {
          for (int i = 0; i < batch.size; ++i) batch.rows[axis][row][i] *= roots[i];
        }
      }
    }
    for (int axis = 0; axis < 2; ++axis) {
      for (int row = 0; row < sizes[axis] && padded != batch.size; ++row) {
        std::fill(batch.rows[axis][row] + batch.size, batch.rows[axis][row] + padded, 0.0);
      }
      products_of[axis].Add(batch.rows[axis][0], padded);
    }
  }
  products->matrix.setZero(num_columns_, num_columns_);
  const double per_px2 = 1 / (pixel_sigma_px_ * pixel_sigma_px_);
  for (int axis = 0; axis < 2; ++axis) {
    products_of[axis].AddTo(axes_[axis].places.data(), per_px2, &products->matrix);
  }
  for (Eigen::Index i = 0; i < num_columns_; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) products->matrix(j, i) = products->matrix(i, j);
  }
  products->loss_remainder = sums.Remainder();
  return true;
}

// Computes the rows of a view before whitening, for points of any kind.
bool ViewReducer::PredictRows(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
                              const TargetShape* shape, ViewRows* rows) const {
  Observations shaped;
  if (shape != nullptr) shaped = ApplyShape(observations, *shape);
  Points2 pixels;
  ProjectionJacobian jacobian;
  if (!Predict(model_, params, camera_from_target, shape != nullptr ? shaped : observations, &pixels, &jacobian)) {
    return false;
  }
  const int n = observations.size();
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  for (int axis = 0; axis < 2; ++axis) {
    const ProjectionJacobian::Rows& predicted = axis == 0 ? jacobian.u : jacobian.v;
    auto own = rows->columns.middleRows(axis * n, n);
    own.leftCols<6>() = predicted.topRows<6>().transpose();
    const AxisColumns& columns = axes_[axis];
    for (size_t i = 6; i < columns.rows.size(); ++i) {
      own.col(columns.places[i]) = predicted.row(6 + ParameterOfRow(columns.rows[i], axis)).transpose();
    }
    own.col(num_columns_ - 1) = (pixels.row(axis) - observations.pixels.row(axis)).transpose();
    const Eigen::Index first_shape = num_columns_ - 1 - static_cast<Eigen::Index>(free_shape_.size());
    for (int i = 0; i < n && shape != nullptr && !free_shape_.empty(); ++i) {
      const Eigen::RowVector3d by_position = own.block<1, 3>(i, 0) * rotation;
      const auto by_params = ShapedByParams(Eigen::Vector3d(observations.points_in_target.col(i)), *shape);
      for (size_t k = 0; k < free_shape_.size(); ++k) {
        own(i, first_shape + static_cast<Eigen::Index>(k)) = by_position.dot(by_params.col(free_shape_[k]));
      }
    }
  }
  return true;
}

bool ViewReducer::Write(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
                        const TargetShape* shape, ViewRows* rows) const {
  const int n = observations.size();
  rows->size = 2 * n;
  rows->columns.setZero(PaddedToLanes(2 * n), num_columns_ + num_columns_ % 2);
  if (IsPlain(observations)) {
    const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
    ProjectionBatch batch;
    for (int first = 0; first < n; first += batch.size) {
      if (!WriteBatch(params, rotation, camera_from_target.translation, observations, shape, first, &batch)) {
        return false;
      }
      for (int axis = 0; axis < 2; ++axis) {
        for (int row = 0; row < axes_[axis].size(); ++row) {
          double* const column = rows->columns.col(axes_[axis].places[static_cast<size_t>(row)]).data();
          std::copy_n(batch.rows[axis][row], batch.size, column + axis * n + first);
        }
      }
    }
  } else {
    if (!PredictRows(params, camera_from_target, observations, shape, rows)) return false;
    Whiten(observations, n, &rows->columns);
  }
  Sums sums;
  if (IsWeighted(loss_)) {
    Eigen::ArrayXd roots(n);
    const double* const residuals = rows->columns.col(num_columns_ - 1).data();
    WeighPoints(residuals, residuals + n, n, roots.data(), &sums);
    for (int axis = 0; axis < 2; ++axis) rows->columns.middleRows(axis * n, n).array().colwise() *= roots;
  }
  rows->columns /= pixel_sigma_px_;
  rows->loss_remainder = sums.Remainder();
  return true;
}

bool ViewReducer::Multiply(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
                           const TargetShape* shape, ViewNormalEquations* products) const {
  if (IsPlain(observations)) return MultiplyPlain(params, camera_from_target, observations, shape, products);
  ViewRows rows;
  if (!Write(params, camera_from_target, observations, shape, &rows)) return false;
  GramMatrix sums(num_columns_, rows.columns.rows());
  sums.Add(rows.columns.data(), rows.columns.rows());
  products->matrix = sums.Matrix();
  products->loss_remainder = rows.loss_remainder;
  return true;
}

bool ViewReducer::Reduce(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
                         const TargetShape* shape, SquareRootInformation* reduction) const {
  if (2 * observations.size() > num_columns_) {
    ViewNormalEquations products;
    if (!Multiply(params, camera_from_target, observations, shape, &products)) return false;
    reduction->factor = PivotedCholesky(products.matrix);
    // All rows but the last are rotated such that the pose columns are zero below row six.
    auto rotated = reduction->factor.topRows(num_columns_ - 1);
    const HouseholderFactor qr(rotated.leftCols<6>());
    rotated.rightCols(num_columns_ - 6) = qr.Rotated(rotated.rightCols(num_columns_ - 6));
    rotated.topLeftCorner<6, 6>() = qr.R();
    rotated.bottomLeftCorner(num_columns_ - 7, 6).setZero();
    reduction->loss_remainder = products.loss_remainder;
    return true;
  }
  // A view with no more rows than columns keeps its rows.
  ViewRows rows;
  if (!Write(params, camera_from_target, observations, shape, &rows)) return false;
  reduction->factor = rows.columns.topLeftCorner(rows.size, num_columns_);
  reduction->loss_remainder = rows.loss_remainder;
  return true;
}

std::optional<Eigen::MatrixXd> RowsByPoints(const CameraModel& model, const double* params,
                                            const Rigid3d& camera_from_target, const Observations& observations,
                                            const TargetShape* shape, double pixel_sigma_px) {
  const Observations shaped = shape != nullptr ? ApplyShape(observations, *shape) : observations;
  Points2 pixels;
  ProjectionJacobian jacobian;
  if (!Predict(model, params, camera_from_target, shaped, &pixels, &jacobian)) return std::nullopt;
  const Eigen::Index n = observations.size();
  const Eigen::Matrix3d rotation = camera_from_target.RotationMatrix();
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(2 * n, 3 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    // Displacing a point changes its projection as the same translation of the whole target would.
    rows.block<1, 3>(i, 3 * i) = jacobian.u.col(i).head<3>().transpose() * rotation;
    rows.block<1, 3>(n + i, 3 * i) = jacobian.v.col(i).head<3>().transpose() * rotation;
  }
  Whiten(observations, n, &rows);
  return rows / pixel_sigma_px;
}

void WeighPosePart(double variance_ratio, Eigen::MatrixXd* products) {
  if (variance_ratio == 1) return;
  const Eigen::Matrix<double, 6, 6> of_pose = products->topLeftCorner<6, 6>();
  const Eigen::MatrixXd mixed = products->topRows<6>();
  *products -= (1 - 1 / variance_ratio) * mixed.transpose() * SolveSymmetric(of_pose, mixed);
}

void WeighPoseRows(double variance_ratio, Eigen::MatrixXd* rows) {
  if (variance_ratio == 1) return;
  const Eigen::MatrixXd basis = HouseholderFactor(rows->leftCols<6>()).Basis();
  *rows -= (1 - 1 / std::sqrt(variance_ratio)) * basis * (basis.transpose() * *rows);
}

Eigen::MatrixXd PivotedCholesky(const Eigen::MatrixXd& products) {
  const Eigen::Index n = products.cols();
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(n, n);
  // The remainder, scaled to a unit diagonal; only the lower triangle of the symmetric matrix is used.
  Eigen::MatrixXd rest = products;
  Eigen::VectorXd lengths(n);
  for (Eigen::Index i = 0; i < n; ++i) lengths[i] = std::sqrt(std::max(0.0, products(i, i)));
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = j; i < n; ++i)
      rest(i, j) = lengths[i] * lengths[j] > 0 ? rest(i, j) / lengths[i] / lengths[j] : 0;
  }
  const double nothing = static_cast<double>(n) * std::numeric_limits<double>::epsilon();
  // The pivot's row of the factor.
  Eigen::VectorXd row(n);
  for (Eigen::Index step = 0; step + 1 < n; ++step) {
    Eigen::Index pivot = 0;
    if (rest.diagonal().head(n - 1).maxCoeff(&pivot) <= nothing) break;
    row.head(pivot) = rest.row(pivot).head(pivot).transpose();
    row.tail(n - pivot) = rest.col(pivot).tail(n - pivot);
    row /= std::sqrt(rest(pivot, pivot));
    for (Eigen::Index j = 0; j < n; ++j) {
      if (row[j] == 0) continue;  // Zero for all earlier pivots.
      rest.col(j).tail(n - j) -= row[j] * row.tail(n - j);
      root(step, j) = row[j] * lengths[j];
    }
    rest.row(pivot).head(pivot).setZero();
    rest.col(pivot).tail(n - pivot).setZero();
  }
  root(n - 1, n - 1) = std::sqrt(std::max(0.0, rest(n - 1, n - 1))) * lengths[n - 1];
  return root;
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
  if (shape != nullptr) shaped = ApplyShape(observations, *shape);
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
