// One view's reprojection errors, however many points it has, as a handful of rows.
//
// Every residual of a view depends on the six numbers of camera_from_target and on the camera's parameters only. With
// J = [d r / d pose, d r / d camera, r], any R with R^T R = J^T J has the same cost, gradient and Gauss-Newton matrix
// as all the view's rows: a Cholesky factor of the products, at most one more row than there are unknowns. The products
// take one pass over the points, several at once (heba/base/column_products.h).
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"
#include "heba/data/problem.h"
#include "solvers/free_parameters.h"
#include "solvers/loss.h"

namespace heba {

// J^T J of a view.
struct ViewProducts {
  // Columns as ViewReduction::factor's.
  Eigen::MatrixXd matrix;
  double loss_remainder = 0;  // As ViewReduction's.
};

// False if a point has no image from that pose. `free` says of which parameters, the camera's and then the shape's,
// there are columns. With `shape` the points are where it puts them; null if `free` does not speak of it.
bool MultiplyView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                  const Observations& observations, double pixel_sigma_px, const Loss& loss, const FreeParameters& free,
                  const TargetShape* shape, ViewProducts* products);

// Rows R with R^T R = `products`, which is positive semidefinite up to rounding, and as many of them as it has; the
// last one has nothing but its last number. Pivoted Cholesky of the matrix scaled to ones on its diagonal: what is
// below rounding is zero.
Eigen::MatrixXd RootOfProducts(const Eigen::MatrixXd& products);

struct ViewReduction {
  // Columns: of a left perturbation of the pose (6, as Predict's, heba/data/prediction.h), of the camera's parameters
  // that are free, of the shape's, then the residual. Whitened, weighted by the loss's weight at this point.
  Eigen::MatrixXd factor;
  // Sum of rho less the weighted sum of squares, not negative: with it, the squared norm of the last column is the sum
  // of rho.
  double loss_remainder = 0;
};

// False as MultiplyView.
bool ReduceView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                const Observations& observations, double pixel_sigma_px, const Loss& loss, const FreeParameters& free,
                const TargetShape* shape, ViewReduction* reduction);

// How many of `most` threads a pass over so many points is worth: one takes longer to start than some thousand points.
int ThreadsFor(int num_points, int most);

// Of each point, its squared residual after whitening (Observations::whitening), px^2. Nothing where MultiplyView is
// false. Without a shape the points are where they are.
std::optional<std::vector<double>> WhitenedSquares(const CameraModel& model, const double* params,
                                                   const Rigid3d& camera_from_target, const Observations& observations,
                                                   const TargetShape* shape);

}  // namespace heba
