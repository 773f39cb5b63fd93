// The robot poses as observations: how their noise enters the model, and linearised views to estimate it.
//
// Capture i sees the target from
//   camera_from_target = camera_from_camera_mount * M_i * Exp(xi_i) * target_mount_from_target   (eye-to-hand)
//   camera_from_target = camera_from_camera_mount * Exp(-xi_i) * M_i * target_mount_from_target  (eye-in-hand)
// with M_i = camera_mount_from_target_mount as reported by the robot and xi_i its error, expressed in the gripper's
// frame. Equations (1) to (3), (10) and (12) of docs/estimation.md.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "heba/data/solution.h"
#include "heba/kernels/small_matrix.h"
#include "solvers/uncertainty/information.h"

namespace heba {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Returns camera_from_target with a capture's correction, gripper_from_corrected_gripper.
Rigid3d CameraFromTarget(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                         const Rigid3d& correction);

// Returns the correction for which the function above returns `camera_from_target`.
Rigid3d CorrectionFor(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                      const Rigid3d& camera_from_target);

// Returns the derivative of the left perturbation of camera_from_target with respect to the tangent of the
// correction.
Matrix6 LeftFromCorrection(Setup setup, const HandEye& hand_eye, const Rigid3d& camera_mount_from_target_mount,
                           const Rigid3d& correction);

// The prior that a capture's correction is zero within `noise`: six whitened residuals and their derivatives with
// respect to the tangent of the correction.
struct CorrectionPrior {
  Tangent6 residual = Tangent6::Zero();
  Matrix6 by_tangent = Matrix6::Zero();
};
CorrectionPrior CorrectionPriorAt(const Rigid3d& correction, const RobotNoise& noise);

// One capture, linearised: offset = by_unknowns * step + by_correction * xi + noise, where the noise has unit
// variance (pixel sigma and loss applied).
struct LinearisedView {
  Eigen::MatrixXd by_unknowns;                             // For the columns see Information::names.
  Eigen::Matrix<double, Eigen::Dynamic, 6> by_correction;  // Derivatives w.r.t. xi: m, rad.
  Eigen::VectorXd offset;
  // Number of rows at the end that do not depend on the correction.
  Eigen::Index num_rows_without_correction = 0;
  // Pixel residuals that are independent of the rows above: their sum of squares and their number.
  double residual_sum_of_squares = 0;
  int num_residual_dof = 0;
};

// Linearises all views. `corrections` may be empty if there are none. Returns nothing if a point cannot be projected.
std::optional<std::vector<LinearisedView>> LineariseViews(const Problem& problem, const HandEye& hand_eye,
                                                          const std::vector<Rigid3d>& corrections,
                                                          const FreeParameters& free, double pixel_sigma_px,
                                                          const Loss& loss);

// Likewise for the problem's views at a solution, which provides the camera, the target's shape and the weights of
// the points.
std::optional<std::vector<LinearisedView>> LineariseViewsAt(const Problem& problem, const Solution& solution,
                                                            const std::vector<Rigid3d>& corrections,
                                                            const FreeParameters& free, const Loss& loss);

// Returns the covariance of a view's rows, marginalised over its correction: p I + G Q G^T, p in the views' unit.
Eigen::MatrixXd MarginalCovariance(const LinearisedView& view, double pixel_variance, double translation_m2,
                                   double rotation_rad2);
// Returns by_unknowns and, as the last column, the offset, both whitened with this covariance.
RowMajorMatrix WhitenedRows(const LinearisedView& view, double pixel_variance, double translation_m2,
                            double rotation_rad2);

// Returns the normal matrix of the unknowns, marginalised over the corrections: sum J^T (p I + G Q G^T)^-1 J, where p
// is `pixel_variance` in the views' unit.
Eigen::MatrixXd MarginalInformation(const std::vector<LinearisedView>& views, const RobotNoise& noise,
                                    double pixel_variance);

// Returns the probability that a vector with this covariance, estimated with `dof` degrees of freedom, is at least as
// large as `vector` (Fisher's F over the directions whose variance is not below `nothing`), or 1 if there is no such
// direction. Vector and covariance must be in coordinates of similar magnitude.
double ChanceOf(const Tangent6& vector, const Matrix6& covariance, double nothing, double dof);

}  // namespace heba
