// Reduces the reprojection errors of one view to a few rows, independent of its number of points.
//
// Every residual of a view depends only on the six parameters of camera_from_target and on the parameters of camera
// and target shape. With J = [d r / d pose, d r / d camera, d r / d shape, r], any R with R^T R = J^T J has the same
// cost, gradient and Gauss-Newton matrix as all rows of the view. R is a Cholesky factor of J^T J and has at most one
// row more than there are unknowns. J^T J is accumulated in one pass over the points, several points at once
// (heba/kernels/gram_matrix.h). Equation (7) of docs/estimation.md.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"
#include "heba/data/free_parameters.h"
#include "heba/data/pair_problem.h"
#include "solvers/residuals/loss.h"

namespace heba {

// J^T J of a view, whitened and weighted by the loss at the current residuals. The columns are the left perturbation
// of the pose (6, as in Predict, heba/data/prediction.h), the free camera parameters, the free shape parameters and
// the residual.
struct ViewNormalEquations {
  Eigen::MatrixXd matrix;
  // Sum of rho minus the weighted sum of squares, not negative. Added to the last diagonal element, it gives the sum
  // of rho.
  double loss_remainder = 0;
};

// All rows of a view: first those of u, then those of v, then zeros up to a multiple of kMaxLanes
// (heba/kernels/simd.h). The columns are those of ViewNormalEquations, followed by a column of zeros if their number
// is odd.
struct ViewRows {
  int size = 0;  // Number of rows without the zeros.
  Eigen::MatrixXd columns;
  double loss_remainder = 0;  // See ViewNormalEquations.
};

// A factor with at most as many rows as columns and the same J^T J. If the view has more rows than columns, the
// factor is square and its pose columns are zero below row six; otherwise the factor holds the rows of the view
// unchanged.
struct SquareRootInformation {
  Eigen::MatrixXd factor;
  double loss_remainder = 0;  // See ViewNormalEquations.
};

// Converts views to rows, given a camera model, the parameters that have columns, the pixel sigma and the loss.
//
// All functions return false if a point cannot be projected from that pose. `shape` displaces the points of the
// target; it is null if `free` has no entries for the shape.
class ViewReducer {
 public:
  // `model` and `loss` must outlive this object.
  ViewReducer(const CameraModel& model, const FreeParameters& free, double pixel_sigma_px, const Loss& loss);

  // Computes the normal equations.
  bool Multiply(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
                const TargetShape* shape, ViewNormalEquations* products) const;
  // Computes all rows.
  bool Write(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
             const TargetShape* shape, ViewRows* rows) const;
  // Computes the square-root information.
  bool Reduce(const double* params, const Rigid3d& camera_from_target, const Observations& observations,
              const TargetShape* shape, SquareRootInformation* reduction) const;

  int num_columns() const { return num_columns_; }

 private:
  struct Sums;
  // The columns that concern one image axis.
  struct AxisColumns {
    std::vector<int> rows;    // Rows of a batch (ProjectionBatch::rows) that are columns of the products.
    std::vector<int> places;  // Columns of the products: those of `rows`, then shape and residual. Ascending.
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

// Returns the derivatives of all rows of a view (ViewReducer::Write without a loss) by the positions of its points in
// the target, three columns for each point; nothing if a point cannot be projected.
std::optional<Eigen::MatrixXd> RowsByPoints(const CameraModel& model, const double* params,
                                            const Rigid3d& camera_from_target, const Observations& observations,
                                            const TargetShape* shape, double pixel_sigma_px);

// Divides the part of the products that a pose explains by `variance_ratio`: M becomes
//   M - (1 - 1 / ratio) M_p M_pp^-1 M_p^T,
// where M_p are the first six columns of M and M_pp its first six rows of them. These are the products of residuals
// that have, beside independent errors of the points, an error of the image that acts like another pose of the target,
// with the covariance (ratio - 1) M_pp^-1 (the g-prior of Zellner, "On assessing prior distributions and Bayesian
// regression analysis with g-prior distributions", 1986).
void WeighPosePart(double variance_ratio, Eigen::MatrixXd* products);
// Likewise for rows whose first six columns are the derivatives by the pose.
void WeighPoseRows(double variance_ratio, Eigen::MatrixXd* rows);

// Returns R with R^T R = `products`, which must be positive semidefinite up to rounding. R has as many rows as
// `products`; its last row is zero except for the last element. Pivoted Cholesky factorisation of the matrix scaled
// to a unit diagonal; remainders below rounding are set to zero.
Eigen::MatrixXd PivotedCholesky(const Eigen::MatrixXd& products);

// Returns how many threads, at most `most`, are worthwhile for a pass over this many points: starting a thread takes
// longer than processing some thousand points.
int ThreadsFor(int num_points, int most);

// Returns each point's squared residual after whitening (Observations::whitening), px^2, or nothing if any point
// cannot be projected. Without a shape the points are used as designed.
std::optional<std::vector<double>> WhitenedSquares(const CameraModel& model, const double* params,
                                                   const Rigid3d& camera_from_target, const Observations& observations,
                                                   const TargetShape* shape);

}  // namespace heba
