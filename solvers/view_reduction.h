// One view's reprojection errors, however many points it has, as a handful of rows.
//
// Every residual of a view depends on the six numbers of camera_from_target and on the camera's parameters only. With
// J = [d r / d pose, d r / d camera, r], any R with R^T R = J^T J has the same cost, gradient and Gauss-Newton matrix
// as all the view's rows: the rows of a QR factor, at most one more than there are unknowns.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "heba/camera/camera_model.h"
#include "heba/data/problem.h"
#include "solvers/loss.h"

namespace heba {

struct ViewReduction {
  // Columns: those of Predict (heba/data/prediction.h), those of TargetShape::params if they are asked for, then the
  // residual. Whitened, weighted by the loss's weight at this point.
  Eigen::MatrixXd factor;
  // Sum of rho less the weighted sum of squares, not negative: with it, the squared norm of the last column is the sum
  // of rho.
  double loss_remainder = 0;
};

// Rows of ViewReduction::factor for a view.
int NumReducedRows(const CameraModel& model, const Observations& observations, bool with_shape);

// False if a point has no image from that pose. With `shape` the points are where it puts them, and it is unknown too.
bool ReduceView(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
                const Observations& observations, double pixel_sigma_px, const Loss& loss, ViewReduction* reduction,
                const TargetShape* shape = nullptr);

// Of each point, its squared residual after whitening (Observations::whitening), px^2. Nothing if a point has no image
// from that pose.
std::optional<std::vector<double>> WhitenedSquares(const CameraModel& model, const double* params,
                                                   const Rigid3d& camera_from_target, const Observations& observations);

// The sum of rho alone.
bool ViewCost(const CameraModel& model, const double* params, const Rigid3d& camera_from_target,
              const Observations& observations, double pixel_sigma_px, const Loss& loss, double* sum_rho);

}  // namespace heba
