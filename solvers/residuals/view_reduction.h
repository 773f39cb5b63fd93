// One view's reprojection errors, however many points it has, as a handful of rows.
//
// Every residual of a view depends on the six numbers of camera_from_target and on the camera's parameters only. With
// J = [d r / d pose, d r / d camera, r], any R with R^T R = J^T J has the same cost, gradient and Gauss-Newton matrix
// as all the view's rows: a Cholesky factor of the products, at most one more row than there are unknowns. The products
// take one pass over the points, several at once (heba/kernels/gram_matrix.h).
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"
#include "heba/data/problem.h"
#include "solvers/residuals/free_parameters.h"
#include "solvers/residuals/loss.h"

namespace heba {

// J^T J of a view. Columns: of a left perturbation of the pose (6, as Predict's, heba/data/prediction.h), of the
// camera's parameters that are free, of the shape's, then the residual. Whitened, weighted by the loss's weight at this
// point.
struct ViewNormalEquations {
  Eigen::MatrixXd matrix;
  // Sum of rho less the weighted sum of squares, not negative: with it, the last number of the diagonal is the sum of
  // rho.
  double loss_remainder = 0;
};

// All rows of a view as they are: those of u, then those of v, then zeros up to a multiple of kMaxLanes
// (heba/kernels/simd.h). Columns as ViewNormalEquations' (and one of zeros more if their number is odd).
struct ViewRows {
  int size = 0;  // Without the zeros.
  Eigen::MatrixXd columns;
  double loss_remainder = 0;  // As ViewNormalEquations'.
};

// As many rows as there are columns, or fewer, with the same products. Where they are as many, the pose's columns have
// nothing below the first six.
struct SquareRootInformation {
  Eigen::MatrixXd factor;
  double loss_remainder = 0;  // As ViewNormalEquations'.
};

// What views become rows with: a camera model, which of its parameters, and then of the shape's, have columns, how
// exact a point is, and how much it counts when it is far off.
//
// All return false if a point has no image from that pose. With `shape` the points are where it puts them; null if
// `free` does not speak of it.
class ViewReducer {
 public:
  // `model` and `loss` must outlive it.
  ViewReducer(const CameraModel& model, const FreeParameters& free, double pixel_sigma_px, const Loss& loss);

  bool Multiply(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
                const TargetShape* shape, ViewNormalEquations* products) const;
  bool Write(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
             const TargetShape* shape, ViewRows* rows) const;
  bool Reduce(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
              const TargetShape* shape, SquareRootInformation* reduction) const;

  int num_columns() const { return num_columns_; }

 private:
  struct Sums;
  // Of one image axis.
  struct AxisColumns {
    std::vector<int> rows;    // Which of a batch's rows (ProjectionBatch::rows) are columns of the products.
    std::vector<int> places;  // Which columns: of these rows, then of the shape and the residual. Ascending.
    int size() const { return static_cast<int>(places.size()); }
  };

  void WeighPoints(const double* u, const double* v, int size, double* roots, Sums* sums) const;
  bool WriteBatch(const double* params, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation,
                  const Observations& observations, const TargetShape* shape, int first, ProjectionBatch* batch) const;
  bool MultiplyPlain(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
                     const TargetShape* shape, ViewNormalEquations* products) const;
  bool PredictRows(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
                   const TargetShape* shape, ViewRows* rows) const;

  const CameraModel& model_;
  double pixel_sigma_px_;
  const Loss& loss_;
  int num_columns_;
  AxisColumns axes_[2];
  std::vector<int> free_shape_;
};

// Rows R with R^T R = `products`, which is positive semidefinite up to rounding, and as many of them as it has; the
// last one has nothing but its last number. Pivoted Cholesky of the matrix scaled to ones on its diagonal: what is
// below rounding is zero.
Eigen::MatrixXd PivotedCholesky(const Eigen::MatrixXd& products);

// How many of `most` threads a pass over so many points is worth: one takes longer to start than some thousand points.
int ThreadsFor(int num_points, int most);

// Of each point, its squared residual after whitening (Observations::whitening), px^2. Nothing where a point has no
// image. Without a shape the points are where they are.
std::optional<std::vector<double>> WhitenedSquares(const CameraModel& model, const double* params,
                                                   const Rigid3d& camera_from_target, const Observations& observations,
                                                   const TargetShape* shape);

}  // namespace heba
